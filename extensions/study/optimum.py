"""The trials of an optimisation, and what the best of them gain on training and held-out runs.

All of it is computed from the stored runs, so that it does not depend on how often a study was
stopped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.cosim.results.comparison import change_of
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.extensions.study.groups import Point, Runs
from hexapod_cosim.extensions.study.objective import WALKED
from hexapod_cosim.extensions.study.records import Optimise, Value
from hexapod_cosim.extensions.study.store import FIGURES

OPTIMUM = "optimum.json"  # its name in the study's folder
PARTS = {"training": False, "held_out": True}  # whether the runs are held out


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
