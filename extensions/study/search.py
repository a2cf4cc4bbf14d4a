"""Runs an optimisation: trials of settings on training runs, then the best ones on held-out runs.

Optuna's samplers are seeded and asked for a batch of trials at a time, so equal results lead to
equal trials: a study that is resumed asks again from the first trial, and finds the results in
the store. Held-out runs are numbered after all training runs, and made from scenarios and seeds
that the search does not use.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import write_json
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.extensions.study.dispatch import ResultSink, dispatch
from hexapod_cosim.extensions.study.groups import Runs
from hexapod_cosim.extensions.study.optimum import (
    OPTIMUM,
    Trial,
    best_of,
    made_trial,
    means_of,
    optimum_of,
)
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
from hexapod_cosim.extensions.study.workers import Workers

WORST = 1e9  # objective of a trial without a mean; samplers take no infinities as constraints


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
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution  # noqa: PLC0415

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
