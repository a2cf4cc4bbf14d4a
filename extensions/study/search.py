"""Runs an optimisation: trials of settings on training runs, then the best ones on held-out runs.

Optuna's samplers are seeded and asked for a batch of trials at a time, so equal results lead to
equal trials: a study that is resumed asks again from the first trial, and finds the results in
the store. Held-out runs are numbered after all training runs, and made from scenarios and seeds
that the search does not use.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.files import write_json
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.results.comparison import change_of
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.extensions.study.dispatch import ResultSink, dispatch
from hexapod_cosim.extensions.study.objective import WALKED
from hexapod_cosim.extensions.study.records import (
    INTEGERS,
    LOGUNIFORM,
    VALUES,
    Factor,
    Optimise,
    Order,
    Study,
    StudyError,
)
from hexapod_cosim.extensions.study.runs import Optimisation
from hexapod_cosim.extensions.study.summary import OPTIMUM, Trial, feasible
from hexapod_cosim.extensions.study.workers import Workers

WORST = 1e9  # objective of a trial without a mean; samplers take no infinities as constraints


def optimise(sink: ResultSink, workers: Workers, folder: Path) -> None:
    """Runs all trials, then the held-out runs of the best ones, and writes optimum.json."""
    plan = Optimisation(sink.study)
    trials = list(_search(plan, sink, workers))
    (start,) = _rows(sink, workers, [plan.training(plan.asked.trials, plan.unset)])
    chosen = best_of(trials, plan.asked)
    pairs = [(plan.asked.trials, plan.unset), *((one.number, one.values) for one in chosen)]
    sets = [plan.held_out(place, *pair) for place, pair in enumerate(pairs)]
    start_held, *held = _rows(sink, workers, sets)
    trained = _rows(sink, workers, [plan.training(item.number, item.values) for item in chosen])
    names = [factor.name for factor in plan.study.factors]
    best = [
        {
            "trial": trial.number,
            "values": dict(zip(names, trial.values, strict=True)),
            "feasible": trial.feasible,
            "training": dict(trial.means),
            "held_out": _means(after, plan.asked),
            "change": {
                "training": _changes(start, rows, plan.asked),
                "held_out": _changes(start_held, after, plan.asked),
            },
        }
        for trial, rows, after in zip(chosen, trained, held, strict=True)
    ]
    before = {"training": _means(start, plan.asked), "held_out": _means(start_held, plan.asked)}
    content = {
        "metrics": list(plan.asked.metrics),
        "variables": names,
        "before": before,
        "best": best,
    }
    write_json(folder / OPTIMUM, content)


def _search(plan: Optimisation, sink: ResultSink, workers: Workers) -> Iterator[Trial]:
    """Runs a batch of trials at a time and yields them."""
    study, number = make_sampler(plan.study), 0
    while number < plan.asked.trials:
        asked = [
            study.ask(distributions(plan.study.factors))
            for _ in range(min(plan.asked.batch, plan.asked.trials - number))
        ]
        values = [
            tuple(trial.params[factor.name] for factor in plan.study.factors) for trial in asked
        ]
        sets = [plan.training(number + k, item) for k, item in enumerate(values)]
        results = _rows(sink, workers, sets)
        for handle, item, rows in zip(asked, values, results, strict=True):
            means = _means(rows, plan.asked)
            trial = Trial(
                number=number, values=item, means=means, feasible=feasible(means, plan.asked)
            )
            _tell_sampler(study, handle, trial, plan.asked)
            yield trial
            number += 1


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
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution  # noqa: PLC0415

    def distribution(factor: Factor) -> Any:
        if factor.kind == VALUES:
            return CategoricalDistribution(factor.values)
        if factor.kind == INTEGERS:
            return IntDistribution(int(factor.low), int(factor.high))
        return FloatDistribution(factor.low, factor.high, log=factor.kind == LOGUNIFORM)

    return {factor.name: distribution(factor) for factor in variables}


def _tell_sampler(study: Any, handle: Any, trial: Trial, question: Optimise) -> None:
    """Gives Optuna the means of a trial; `handle` is its own object for the trial."""
    for bound in question.constraints:
        handle.set_constraint(bound.metric, min(bound.excess(trial.means[bound.metric]), WORST))
    worst = [WORST if METRICS[name][1] else -WORST for name in question.metrics]
    values = [trial.means[name] for name in question.metrics]
    pairs = zip(values, worst, strict=True)
    study.tell(handle, [bad if math.isnan(value) else value for value, bad in pairs])


def _rows(
    sink: ResultSink, workers: Workers, sets: Sequence[list[Order]]
) -> list[list[dict[str, Any]]]:
    """Returns the stored rows of sets of orders, after running those that are not stored."""
    orders = [order for part in sets for order in part]
    stored = sink.store.rows([order.run for order in orders])
    missing = [order for order in orders if order.run not in stored]
    dispatch(sink, workers, missing)
    stored |= sink.store.rows([order.run for order in missing])
    return [[stored[order.run] for order in part] for part in sets]


def _means(rows: Sequence[Mapping[str, Any]], asked: Optimise) -> dict[str, float]:
    """Returns the means of the metrics of objectives and constraints, by name.

    A mean is over the walks that have the metric (a walk on the spot has no slip per metre). It
    is NaN when one of the runs did not walk to its end.
    """
    names = _metric_names(asked)
    whole = all(row["walked"] for row in rows)
    found: dict[str, float] = {}
    for name in names:
        values = [float(row[name]) for row in rows if row[name] is not None]
        found[name] = float(np.mean(values)) if values and (whole or name == WALKED) else math.nan
    return found


def _metric_names(asked: Optimise) -> list[str]:
    """Returns the metrics of objectives and constraints, each once."""
    return list(dict.fromkeys([*asked.metrics, *(bound.metric for bound in asked.constraints)]))


def _changes(
    before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]], asked: Optimise
) -> dict[str, dict[str, Any]]:
    """Returns the changes of metrics as `hexapod compare` computes them, by name.

    They are over pairs of runs of the same scenario, seed and control that both walked to the end.
    """
    pairs = [
        (first, second)
        for first, second in zip(before, after, strict=True)
        if first["walked"] and second["walked"]
    ]
    return {
        name: change_of(
            name, [(_or_nan(first[name]), _or_nan(second[name])) for first, second in pairs]
        ).as_table()
        for name in _metric_names(asked)
        if name != WALKED
    }


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def best_of(trials: Sequence[Trial], asked: Optimise) -> list[Trial]:
    """Returns the best trial, or with several metrics up to FRONT trials of their Pareto front.

    The members of the front are chosen evenly. Trials that break a constraint count only when all
    of them do.
    """
    able = [trial for trial in trials if trial.feasible] or list(trials)
    front = sorted(
        (trial for trial in able if not any(_dominates(other, trial, asked) for other in able)),
        key=lambda trial: _costs(trial, asked),
    )
    places = np.unique(
        np.linspace(0, len(front) - 1, min(asked.chosen, len(front))).round().astype(int)
    )
    return [front[place] for place in places.tolist()]


def _costs(trial: Trial, asked: Optimise) -> tuple[float, ...]:
    """Returns the metrics with the sign that makes less better, and the number for ties."""
    signed = (trial.means[name] * (1.0 if METRICS[name][1] else -1.0) for name in asked.metrics)
    return (*(math.inf if math.isnan(value) else value for value in signed), float(trial.number))


def _dominates(other: Trial, trial: Trial, asked: Optimise) -> bool:
    pairs = list(zip(_costs(other, asked)[:-1], _costs(trial, asked)[:-1], strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)
