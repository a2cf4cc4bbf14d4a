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

import math
from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.study.plan.factors import read_factors
from hexapod_cosim.cosim.study.plan.held_out import check_held_out_seeds
from hexapod_cosim.cosim.study.plan.keys import names_of, read_seeds, text_of, whole
from hexapod_cosim.cosim.study.plan.records import (
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
    "metric",
    "constraints",
    "trials",
    "batch",
    "sampler",
    "control",
    "variables",
    "training",
    "held_out",
)
WALKED = "walked"
# metrics of which less or more is better
OBJECTIVES = tuple(
    name for name, (_, less_is_better, _) in METRICS.items() if less_is_better is not None
)
MAX_TRIALS, MAX_SEEDS = 100_000, 10_000


def read_optimise(table: Any, where: str) -> tuple[Optimise, tuple[Factor, ...]]:
    """Returns the optimisation and its variables. Raises StudyError."""
    _check_keys(table, where)
    variables = _variables(table["variables"], f"{where}.variables")
    training, held_out = (
        _evaluation(table[part], f"{where}.{part}") for part in ("training", "held_out")
    )
    check_held_out_seeds(training, held_out, where)
    metric = table["metric"]
    optimise = Optimise(
        metrics=names_of(
            metric if isinstance(metric, list) else [metric], OBJECTIVES, f"{where}.metric"
        ),
        constraints=(
            Bound(metric=WALKED, at_least=1.0),
            *_bounds(table.get("constraints", {}), f"{where}.constraints"),
        ),
        trials=whole(table.get("trials", 50), f"{where}.trials", least=1, most=MAX_TRIALS),
        batch=whole(table.get("batch", 4), f"{where}.batch", least=1, most=1000),
        sampler=names_of(
            [table.get("sampler", "tpe" if not isinstance(metric, list) else "nsga2")],
            SAMPLERS,
            f"{where}.sampler",
        )[0],
        control=text_of(table, "control", "compliant", where),
        training=training,
        held_out=held_out,
    )
    return optimise, variables


def _check_keys(table: Any, where: str) -> None:
    """Raises StudyError for anything but a table with known keys and all required ones."""
    if not isinstance(table, Mapping):
        raise StudyError(
            "wrong type", got=table, expected="a table", fix="write [optimise]", where=where
        )
    for key in table:
        if key not in KEYS:
            raise unknown_name("key", key, KEYS, where=where, error=StudyError)
    for key in ("metric", "variables", "training", "held_out"):
        if key not in table:
            raise StudyError(
                "missing key",
                expected=f"[{key}]" if key != "metric" else 'metric = "slip_per_metre"',
                where=f"{where}.{key}",
            )


def _variables(table: Any, where: str) -> tuple[Factor, ...]:
    """Reads the variables, which are settings or gains with bounds. Raises StudyError."""
    variables = read_factors(table, where)
    if not variables or any(factor.name == SCENARIO_FACTOR for factor in variables):
        raise StudyError(
            "not variables",
            got=[item.name for item in variables],
            expected="settings or gains",
            where=where,
        )
    if any(factor.kind == NORMAL for factor in variables):
        raise StudyError(
            "a variable without bounds",
            got=NORMAL,
            expected="values, uniform, loguniform or integers",
            where=where,
        )
    return variables


def _evaluation(table: Any, where: str) -> Evaluation:
    if not isinstance(table, Mapping):
        raise StudyError(
            "wrong type", got=table, expected="scenarios = [...], seeds = ...", where=where
        )
    for key in table:
        if key not in ("scenarios", "seeds"):
            raise unknown_name("key", key, ("scenarios", "seeds"), where=where, error=StudyError)
    if "scenarios" not in table:
        raise StudyError(
            "missing key",
            expected="a list of scenarios",
            fix='write scenarios = ["walk_flat"]',
            where=f"{where}.scenarios",
        )
    names = table["scenarios"]
    if (
        not isinstance(names, list)
        or not names
        or not all(isinstance(name, str) for name in names)
        or len(set(names)) != len(names)
    ):
        raise StudyError(
            "wrong type", got=names, expected="a list of scenarios", where=f"{where}.scenarios"
        )
    return Evaluation(
        cases=tuple(names),
        seeds=read_seeds(table.get("seeds", 1), f"{where}.seeds", most=MAX_SEEDS),
    )


def _bounds(table: Any, where: str) -> tuple[Bound, ...]:
    if not isinstance(table, Mapping):
        raise StudyError(
            "wrong type", got=table, expected="torque_rms = { at_most = 1.0 }", where=where
        )
    return tuple(_bound(name, value, f"{where}.{name}") for name, value in table.items())


def _bound(name: str, table: Any, where: str) -> Bound:
    if name not in OBJECTIVES:
        raise unknown_name("metric", name, OBJECTIVES, where=where, error=StudyError)
    limits = (
        {key: float(value) for key, value in table.items() if _is_limit(key, value)}
        if isinstance(table, Mapping)
        else {}
    )
    if not limits or len(limits) != len(table):
        raise StudyError(
            "not a constraint",
            got=table,
            expected="at_least or at_most and a number",
            fix="write { at_most = 1.0 }",
            where=where,
        )
    return Bound(metric=name, **limits)


def _is_limit(key: str, value: Any) -> bool:
    return (
        key in ("at_least", "at_most")
        and isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
    )
