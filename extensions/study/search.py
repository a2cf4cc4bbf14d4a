"""Runs an optimisation: trials of settings on training runs, then the best ones on held-out runs.

Optuna's samplers are seeded and asked for a batch of trials at a time, so equal results lead to
equal trials: a study that is resumed asks again from the first trial, and finds the results in
the store. Held-out runs are numbered after all training runs, and made from scenarios and seeds
that the search does not use.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.files import write_json
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.results.comparison import change_of
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.extensions.study.dispatch import ResultSink, dispatch
from hexapod_cosim.extensions.study.groups import Point, Runs
from hexapod_cosim.extensions.study.records import (
    INTEGERS,
    LOGUNIFORM,
    VALUES,
    WALKED,
    Factor,
    Optimise,
    Order,
    Study,
    StudyError,
    Value,
)
from hexapod_cosim.extensions.study.runs import Optimisation
from hexapod_cosim.extensions.study.store import FIGURES
from hexapod_cosim.extensions.study.workers import Workers

OPTIMUM = "optimum.json"
PARTS = {"training": False, "held_out": True}  # whether the runs are held out
WORST = 1e9  # objective of a trial without a mean; samplers take no infinities as constraints


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The settings of a trial of an optimiser and its results on the training runs."""

    number: int
    values: tuple[Value | None, ...]
    means: Mapping[str, float]  # by metric of the objectives and constraints
    feasible: bool


def metric_names(asked: Optimise) -> list[str]:
    """Returns the metrics of objectives and constraints, each once."""
    return list(dict.fromkeys([*asked.metrics, *(bound.metric for bound in asked.constraints)]))


def means_of(runs: Runs, rows: slice, asked: Optimise) -> dict[str, float]:
    """Returns the means of the metrics of objectives and constraints, by name.

    A mean is over the walks that have the metric (a walk on the spot has no slip per metre). It
    is NaN when one of the runs did not walk to its end.
    """
    walked = float(runs.walked[rows].mean())
    names = [name for name in metric_names(asked) if name != WALKED]
    found = runs.figures(rows, names).means[asked.control]
    means = {name: found[name].value if walked == 1.0 else math.nan for name in names}
    return {name: walked if name == WALKED else means[name] for name in metric_names(asked)}


def made_trial(
    number: int, values: tuple[Value | None, ...], means: Mapping[str, float], asked: Optimise
) -> Trial:
    """Returns a trial, which is feasible if its means meet all constraints."""
    feasible = all(bound.excess(means[bound.metric]) <= 0.0 for bound in asked.constraints)
    return Trial(number=number, values=values, means=means, feasible=feasible)


def trials_of(runs: Runs, points: Sequence[Point]) -> list[Trial]:
    """Returns the trials of which all training runs are stored, from all points of the study."""
    asked, groups = runs.study.optimise, runs.groups()
    assert asked is not None
    return [
        made_trial(
            point.number,
            tuple(point.values.values()),
            means_of(runs, groups[point.number, False], asked),
            asked,
        )
        for point in points
        if not point.held_out and point.number < asked.trials
        if point.figures.runs[asked.control] == asked.training.runs
    ]


def optimum_of(runs: Runs, trials: Sequence[Trial]) -> dict[str, Any]:
    """Returns the content of optimum.json of a study whose runs are all stored."""
    asked, groups, factors = runs.study.optimise, runs.groups(), runs.study.factors
    assert asked is not None
    # the number of trials is the number of the settings before the optimisation
    before = {part: groups[asked.trials, held_out] for part, held_out in PARTS.items()}
    best = []
    for trial in best_of(trials, asked):
        after = {part: groups[trial.number, held_out] for part, held_out in PARTS.items()}
        names = [factor.name for factor in factors]
        best.append(
            {
                "trial": trial.number,
                "values": dict(zip(names, trial.values, strict=True)),
                "feasible": trial.feasible,
                **{part: means_of(runs, rows, asked) for part, rows in after.items()},
                "change": {part: _changes(runs, before[part], after[part]) for part in PARTS},
            }
        )
    return {
        "metrics": list(asked.metrics),
        "variables": [factor.name for factor in factors],
        "before": {part: means_of(runs, rows, asked) for part, rows in before.items()},
        "best": best,
    }


def _changes(runs: Runs, before: slice, after: slice) -> dict[str, dict[str, Any]]:
    """Returns the changes of metrics from some rows to others, by name.

    They are computed as by `hexapod compare`, over pairs of runs of the same scenario, seed and
    control that both walked to the end.
    """
    assert runs.study.optimise is not None
    walked = runs.walked[before] & runs.walked[after]
    pairs = np.stack([runs.values[before], runs.values[after]], axis=1)[walked]
    return {
        name: change_of(name, pairs[..., FIGURES.index(name)]).as_table()
        for name in metric_names(runs.study.optimise)
        if name != WALKED
    }


def best_of(trials: Sequence[Trial], asked: Optimise) -> list[Trial]:
    """Returns the best trial, or with several metrics up to FRONT trials of their Pareto front.

    The members of the front are chosen evenly. Trials that break a constraint count only when all
    of them do.
    """
    able = [trial for trial in trials if trial.feasible] or list(trials)
    front = sorted(
        (trial for trial in able if not any(_dominates(other, trial, asked) for other in able)),
        key=lambda trial: (*_costs(trial, asked), trial.number),
    )
    places = np.linspace(0, len(front) - 1, min(asked.chosen, len(front))).round().astype(int)
    return [front[place] for place in np.unique(places).tolist()]


def _costs(trial: Trial, asked: Optimise) -> tuple[float, ...]:
    """Returns the metrics with the sign that makes less better."""
    signed = (trial.means[name] * (1.0 if METRICS[name][1] else -1.0) for name in asked.metrics)
    return tuple(math.inf if math.isnan(value) else value for value in signed)


def _dominates(other: Trial, trial: Trial, asked: Optimise) -> bool:
    one, two = _costs(other, asked), _costs(trial, asked)
    return all(a <= b for a, b in zip(one, two, strict=True)) and one != two


def optimise(sink: ResultSink, workers: Workers, folder: Path) -> None:
    """Runs all trials, then the held-out runs of the best ones, and writes optimum.json."""
    plan = Optimisation(sink.study)
    trials = list(_search(plan, sink, workers))
    before = (plan.asked.trials, plan.unset)
    _run(sink, workers, plan.training(*before))
    chosen = [before, *((trial.number, trial.values) for trial in best_of(trials, plan.asked))]
    sets = [plan.held_out(place, *pair) for place, pair in enumerate(chosen)]
    _run(sink, workers, [order for part in sets for order in part])
    write_json(folder / OPTIMUM, optimum_of(Runs(sink.study, sink.store), trials))


def _search(plan: Optimisation, sink: ResultSink, workers: Workers) -> Iterator[Trial]:
    """Runs a batch of trials at a time and yields them."""
    asked, sampler, runs = plan.asked, make_sampler(plan.study), plan.asked.training.runs
    space = distributions(plan.study.factors)
    for first in range(0, asked.trials, asked.batch):
        numbers = range(first, min(first + asked.batch, asked.trials))
        handles = [sampler.ask(space) for _ in numbers]
        values = [tuple(one.params[item.name] for item in plan.study.factors) for one in handles]
        sets = [plan.training(*pair) for pair in zip(numbers, values, strict=True)]
        _run(sink, workers, [order for part in sets for order in part])
        stored = Runs(plan.study, sink.store, first=first * runs, end=numbers.stop * runs)
        for k, (number, handle, item) in enumerate(zip(numbers, handles, values, strict=True)):
            rows = slice(k * runs, (k + 1) * runs)
            trial = made_trial(number, item, means_of(stored, rows, asked), asked)
            _tell_sampler(sampler, handle, trial, asked)
            yield trial


def _run(sink: ResultSink, workers: Workers, orders: Sequence[Order]) -> None:
    """Runs those of some orders that are not stored."""
    stored = sink.store.numbers(orders[0].run, orders[-1].run + 1)
    missing = [order for order in orders if order.run not in stored]
    dispatch(sink, workers, missing, len(missing))


def make_sampler(study: Study) -> Any:
    """Returns a seeded Optuna study in memory. Raises StudyError when Optuna is missing."""
    try:
        import optuna  # noqa: PLC0415  an extra, and slow to import
    except ImportError as error:
        raise StudyError(
            "Optuna is not installed",
            fix=install_extra("optimise"),
            where=f"{study.where}: optimise",
        ) from error
    asked = study.optimise
    assert asked is not None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    samplers: dict[str, Any] = {
        "tpe": lambda: optuna.samplers.TPESampler(seed=study.seed, constant_liar=True),
        "nsga2": lambda: optuna.samplers.NSGAIISampler(
            seed=study.seed, population_size=max(asked.batch, 8)
        ),
        "random": lambda: optuna.samplers.RandomSampler(seed=study.seed),
    }
    directions: list[Any] = [
        "minimize" if METRICS[name][1] else "maximize" for name in asked.metrics
    ]
    return optuna.create_study(sampler=samplers[asked.sampler](), directions=directions)


def distributions(variables: Sequence[Factor]) -> dict[str, Any]:
    """Returns Optuna's distributions of the variables, by name."""
    from optuna.distributions import (  # noqa: PLC0415
        CategoricalDistribution,
        FloatDistribution,
        IntDistribution,
    )

    def distribution(factor: Factor) -> Any:
        if factor.kind == VALUES:
            return CategoricalDistribution(factor.values)
        if factor.kind == INTEGERS:
            return IntDistribution(int(factor.low), int(factor.high))
        return FloatDistribution(factor.low, factor.high, log=factor.kind == LOGUNIFORM)

    return {factor.name: distribution(factor) for factor in variables}


def _tell_sampler(sampler: Any, handle: Any, trial: Trial, asked: Optimise) -> None:
    """Gives Optuna the means of a trial; `handle` is its own object for the trial."""
    for bound in asked.constraints:
        handle.set_constraint(bound.metric, min(bound.excess(trial.means[bound.metric]), WORST))
    worst = [WORST if METRICS[name][1] else -WORST for name in asked.metrics]
    values = [trial.means[name] for name in asked.metrics]
    pairs = zip(values, worst, strict=True)
    sampler.tell(handle, [bad if math.isnan(value) else value for value, bad in pairs])
