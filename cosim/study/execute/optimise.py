"""Settings that an optimiser proposes, judged on training runs; its best, and what it began from,
judged on runs it never saw.

Optuna's samplers are seeded and asked for a batch at a time, so the same answers bring the same
questions: a study that goes on after a kill asks again from the first trial, and finds the answers
in the store. Held-out runs are numbered after all of training, and made from scenarios and seeds
that the loop around the optimiser does not have.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.files import to_json
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.results.comparison import change_of
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.study.execute.conduct import Desk, conduct
from hexapod_cosim.cosim.study.execute.crew import Crew
from hexapod_cosim.cosim.study.plan.identity import identity
from hexapod_cosim.cosim.study.plan.objective import WALKED
from hexapod_cosim.cosim.study.plan.optimisation import Optimisation
from hexapod_cosim.cosim.study.plan.records import (
    INTEGERS,
    LOGUNIFORM,
    VALUES,
    Factor,
    Optimise,
    Order,
    Study,
    StudyError,
)
from hexapod_cosim.cosim.study.store.store import write_durably
from hexapod_cosim.cosim.study.store.trials import OPTIMUM, Trial, feasible

WORST = 1e9  # what a trial without a figure gets; the samplers take no infinities as constraints


def optimise(desk: Desk, crew: Crew, folder: Path) -> None:
    """Asks, runs and tells until all trials are known; then the held-out runs. Writes
    optimum.json.
    """
    plan = Optimisation(desk.study)
    trials = list(_search(plan, desk, crew))
    begin = _judge(desk, crew, [plan.training(plan.asked.trials, plan.unset)])
    chosen = best_of(trials, plan.asked)
    picked = [plan.unset, *(trial.values for trial in chosen)]
    points = [plan.asked.trials, *(trial.number for trial in chosen)]
    sets = [
        plan.held_out(place, *pair) for place, pair in enumerate(zip(points, picked, strict=True))
    ]
    held = _judge(desk, crew, sets)
    trained = _judge(desk, crew, [plan.training(trial.number, trial.values) for trial in chosen])
    content = {
        "metrics": list(plan.asked.metrics),
        "variables": [factor.name for factor in plan.study.factors],
        "before": {
            "training": _means(begin[0], plan.asked),
            "held_out": _means(held[0], plan.asked),
        },
        "best": [
            {
                "trial": trial.number,
                "values": dict(
                    zip((item.name for item in plan.study.factors), trial.values, strict=True)
                ),
                "feasible": trial.feasible,
                "training": dict(trial.means),
                "held_out": _means(after, plan.asked),
                "change": {
                    "training": _changes(begin[0], rows, plan.asked),
                    "held_out": _changes(held[0], after, plan.asked),
                },
            }
            for trial, rows, after in zip(chosen, trained, held[1:], strict=True)
        ],
    }
    write_durably(folder / OPTIMUM, (to_json(content) + "\n").encode())


def _search(plan: Optimisation, desk: Desk, crew: Crew) -> Iterator[Trial]:
    """All trials, a batch at a time."""
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
        for trial, item, rows in zip(asked, values, _judge(desk, crew, sets), strict=True):
            means = _means(rows, plan.asked)
            yield _told(
                study,
                trial,
                Trial(
                    number=number, values=item, means=means, feasible=feasible(means, plan.asked)
                ),
                plan.asked,
            )
            number += 1


def make_sampler(study: Study) -> Any:
    """Optuna's study: seeded, in memory. Raises StudyError when Optuna is not installed."""
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
    """The variables as Optuna has them."""
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution  # noqa: PLC0415

    found: dict[str, Any] = {}
    for factor in variables:
        if factor.kind == VALUES:
            found[factor.name] = CategoricalDistribution(factor.values)
        elif factor.kind == INTEGERS:
            found[factor.name] = IntDistribution(int(factor.low), int(factor.high))
        else:
            found[factor.name] = FloatDistribution(
                factor.low, factor.high, log=factor.kind == LOGUNIFORM
            )
    return found


def _told(study: Any, asked: Any, trial: Trial, question: Optimise) -> Trial:
    for bound in question.constraints:
        asked.set_constraint(bound.metric, min(bound.excess(trial.means[bound.metric]), WORST))
    worst = [WORST if METRICS[name][1] else -WORST for name in question.metrics]
    values = [trial.means[name] for name in question.metrics]
    study.tell(
        asked,
        [bad if math.isnan(value) else value for value, bad in zip(values, worst, strict=True)],
    )
    return trial


def _judge(desk: Desk, crew: Crew, sets: Sequence[list[Order]]) -> list[list[dict[str, Any]]]:
    """The stored rows of sets of orders, after running those that are not stored."""
    orders = [order for part in sets for order in part]
    stored = desk.store.rows([order.run for order in orders])
    for order in orders:
        if order.run in stored and stored[order.run]["identity"] != identity(
            order, desk.study.factors
        ):
            fix = "choose another folder with -o"
            raise StudyError(
                "the optimiser asks something else than before",
                got=f"run {order.run}",
                fix=fix,
                where=desk.study.where,
            )
    wanted = [order for order in orders if order.run not in stored]
    with closing(conduct(desk, crew, wanted)) as results:
        for _ in results:
            pass
    stored |= desk.store.rows([order.run for order in wanted])
    return [[stored[order.run] for order in part] for part in sets]


def _means(rows: Sequence[Mapping[str, Any]], asked: Optimise) -> dict[str, float]:
    """Of every metric that counts, over the walks that have it (none on the spot has a slip per
    metre); NaN where a run did not walk.
    """
    names = _judged(asked)
    whole = all(row["walked"] for row in rows)
    found: dict[str, float] = {}
    for name in names:
        values = [float(row[name]) for row in rows if row[name] is not None]
        found[name] = float(np.mean(values)) if values and (whole or name == WALKED) else math.nan
    return found


def _judged(asked: Optimise) -> list[str]:
    """Every metric that counts, once."""
    return list(dict.fromkeys([*asked.metrics, *(bound.metric for bound in asked.constraints)]))


def _changes(
    before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]], asked: Optimise
) -> dict[str, dict[str, Any]]:
    """By metric, over pairs of runs of the same scenario, seed and control, of which both
    walked: as `hexapod compare` has changes.
    """
    pairs = [
        (first, second)
        for first, second in zip(before, after, strict=True)
        if first["walked"] and second["walked"]
    ]
    return {
        name: change_of(
            name, [(_figure(first[name]), _figure(second[name])) for first, second in pairs]
        ).as_table()
        for name in _judged(asked)
        if name != WALKED
    }


def _figure(value: float | None) -> float:
    return math.nan if value is None else float(value)


def best_of(trials: Sequence[Trial], asked: Optimise) -> list[Trial]:
    """The best trial, or up to FRONT evenly chosen of those that no other is better than in all
    metrics; none that breaks a constraint where there is one that does not.
    """
    able = [trial for trial in trials if trial.feasible] or list(trials)
    front = sorted(
        (trial for trial in able if not any(_beats(other, trial, asked) for other in able)),
        key=lambda trial: _costs(trial, asked),
    )
    places = np.unique(
        np.linspace(0, len(front) - 1, min(asked.chosen, len(front))).round().astype(int)
    )
    return [front[place] for place in places.tolist()]


def _costs(trial: Trial, asked: Optimise) -> tuple[float, ...]:
    """Less is better."""
    signed = (trial.means[name] * (1.0 if METRICS[name][1] else -1.0) for name in asked.metrics)
    return (*(math.inf if math.isnan(value) else value for value in signed), float(trial.number))


def _beats(other: Trial, trial: Trial, asked: Optimise) -> bool:
    pairs = list(zip(_costs(other, asked)[:-1], _costs(trial, asked)[:-1], strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)
