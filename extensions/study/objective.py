"""Reads the table [optimise] of a study file: objectives, constraints, training and held-out runs.

    [optimise]
    metric = "slip_per_metre"   # or a list, for the Pareto front
    constraints = { torque_rms = { at_most = 1.0 } }
    trials = 60
    batch = 4                   # trials that run at the same time
    [optimise.variables]
    gains.hold.path_rate = { loguniform = [0.3, 3.0], relative = true }
    [optimise.training]
    scenarios = ["walk_flat"]
    seeds = { first = 100, count = 4 }
    [optimise.held_out]         # no scenario and no seed of training
    scenarios = ["ripple", "wave"]
    seeds = { first = 0, count = 10 }

Constraints are of means; that every run walks to its end is always one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.extensions.study.factors import read_factors
from hexapod_cosim.extensions.study.keys import (
    is_number,
    names_of,
    read_seeds,
    require,
    require_known,
    table_of,
    text_of,
    texts_of,
    whole,
)
from hexapod_cosim.extensions.study.records import (
    NORMAL,
    SAMPLERS,
    SCENARIO_FACTOR,
    Bound,
    Evaluation,
    Factor,
    Optimise,
    StudyError,
)
from hexapod_cosim.models import unknown_name

KEYS = (
    *("metric", "constraints", "trials", "batch", "sampler", "control"),
    *("variables", "training", "held_out"),
)
REQUIRED = {
    "metric": 'metric = "slip_per_metre"',
    "variables": "[optimise.variables]",
    "training": "[optimise.training]",
    "held_out": "[optimise.held_out]",
}
WALKED = "walked"
# metrics of which less or more is better
OBJECTIVES = tuple(
    name for name, (_, less_is_better, _) in METRICS.items() if less_is_better is not None
)
MAX_TRIALS, MAX_SEEDS = 100_000, 10_000


def read_optimise(table: Any, where: str) -> tuple[Optimise, tuple[Factor, ...]]:
    """Returns the optimisation and its variables. Raises StudyError."""
    table = table_of(table, where, "write [optimise]")
    require_known(table, KEYS, where)
    for key, expected in REQUIRED.items():
        require(key in table, None, expected, f"{where}.{key}", what="missing key", fix="add it")
    variables = _variables(table["variables"], f"{where}.variables")
    training, held_out = (
        _evaluation(table[part], f"{where}.{part}") for part in ("training", "held_out")
    )
    _check_held_out(training, held_out, f"{where}.held_out")
    place, fix = f"{where}.constraints", "write torque_rms = { at_most = 1.0 }"
    bounds = table_of(table.get("constraints", {}), place, fix)
    metric = table["metric"]
    several = isinstance(metric, list)
    sampler = table.get("sampler", "nsga2" if several else "tpe")
    optimise = Optimise(
        metrics=names_of(metric if several else [metric], OBJECTIVES, f"{where}.metric"),
        constraints=(
            Bound(metric=WALKED, at_least=1.0),
            *(_bound(name, value, f"{place}.{name}") for name, value in bounds.items()),
        ),
        trials=whole(table.get("trials", 50), f"{where}.trials", least=1, most=MAX_TRIALS),
        batch=whole(table.get("batch", 4), f"{where}.batch", least=1, most=1000),
        sampler=names_of([sampler], SAMPLERS, f"{where}.sampler")[0],
        control=text_of(table, "control", "compliant", where),
        training=training,
        held_out=held_out,
    )
    return optimise, variables


def _variables(table: Any, where: str) -> tuple[Factor, ...]:
    """Reads the variables, which are settings or gains with bounds. Raises StudyError."""
    variables = read_factors(table, where)
    names = [factor.name for factor in variables]
    some = len(names) > 0 and SCENARIO_FACTOR not in names
    require(some, names, "settings or gains", where, what="not variables")
    bounded = all(factor.kind != NORMAL for factor in variables)
    expected = "values, uniform, loguniform or integers"
    require(bounded, NORMAL, expected, where, what="a variable without bounds")
    return variables


def _evaluation(table: Any, where: str) -> Evaluation:
    table = table_of(table, where, "write scenarios = [...] and seeds = ...")
    require_known(table, ("scenarios", "seeds"), where)
    example = 'scenarios = ["walk_flat"]'
    names = texts_of(table.get("scenarios"), f"{where}.scenarios", example)
    seeds = read_seeds(table.get("seeds", 1), f"{where}.seeds", most=MAX_SEEDS)
    return Evaluation(cases=names, seeds=seeds)


def _check_held_out(training: Evaluation, held_out: Evaluation, where: str) -> None:
    """Raises StudyError for a held-out scenario or seed that is one of training.

    A seed draws the same changes in every scenario.
    """
    names = sorted(set(training.cases) & set(held_out.cases))
    seeds = sorted(set(training.seeds) & set(held_out.seeds))
    what, fix = "a held-out scenario that is trained on", "name other scenarios"
    expected = "scenarios that the optimiser never sees"
    require(not names, names, expected, f"{where}.scenarios", what=what, fix=fix)
    fix = f"write seeds = {{ first = {max(training.seeds) + 1}, count = {len(held_out.seeds)} }}"
    expected, what = "seeds that the optimiser never sees", "held-out seeds that are trained on"
    require(not seeds, seeds, expected, f"{where}.seeds", what=what, fix=fix)


def _bound(name: str, table: Any, where: str) -> Bound:
    if name not in OBJECTIVES:
        raise unknown_name("metric", name, OBJECTIVES, where=where, error=StudyError)
    limits = isinstance(table, Mapping) and len(table) > 0
    known = limits and all(
        key in ("at_least", "at_most") and is_number(value) for key, value in table.items()
    )
    expected, fix = "at_least or at_most and a number", "write { at_most = 1.0 }"
    require(known, table, expected, where, what="not a constraint", fix=fix)
    return Bound(metric=name, **{key: float(value) for key, value in table.items()})
