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
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.comparison import change_of
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.extensions.study.groups import Array, Runs
from hexapod_cosim.extensions.study.objective import WALKED
from hexapod_cosim.extensions.study.records import Optimise, Study, Value
from hexapod_cosim.extensions.study.store import FIGURES, Store

OPTIMUM = "optimum.json"  # its name in the study's folder


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


def means_of(walked: NDArray[np.bool_], values: Array, asked: Optimise) -> dict[str, float]:
    """Returns the means of the metrics of objectives and constraints, by name.

    A mean is over the walks that have the metric (a walk on the spot has no slip per metre). It
    is NaN when one of the runs did not walk to its end.

    Args:
        walked: (n,) which runs walked.
        values: (n, metrics) of the runs.
    """
    found = {}
    for name in metric_names(asked):
        if name == WALKED:
            found[name] = float(walked.mean())
            continue
        column = values[:, FIGURES.index(name)]
        known = column[np.isfinite(column)]
        found[name] = float(known.mean()) if walked.all() and len(known) else math.nan
    return found


def made_trial(
    number: int, values: tuple[Value | None, ...], means: Mapping[str, float], asked: Optimise
) -> Trial:
    """Returns a trial, which is feasible if its means meet all constraints."""
    feasible = all(bound.excess(means[bound.metric]) <= 0.0 for bound in asked.constraints)
    return Trial(number=number, values=values, means=means, feasible=feasible)


class Parts:
    """The stored runs of an optimisation by trial, on the training and on the held-out runs."""

    def __init__(self, runs: Runs, settings: Sequence[tuple[Any, ...]]) -> None:
        assert runs.study.optimise is not None
        self._runs, self.asked = runs, runs.study.optimise
        starts = runs.starts()
        ends = [*starts[1:], len(runs.number)]
        self._rows = {
            (int(runs.point[start]), bool(runs.held_out[start])): slice(start, end)
            for start, end in zip(starts, ends, strict=True)
        }
        self._values = {
            int(runs.point[start]): values[1:]
            for start, values in zip(starts, settings, strict=True)
        }

    def trials(self) -> list[Trial]:
        """Returns the trials of which all training runs are stored, in their order."""
        return [
            made_trial(number, self._values[number], self.means(number, held_out), self.asked)
            for (number, held_out), rows in self._rows.items()
            if not held_out and number < self.asked.trials
            if rows.stop - rows.start == self.asked.training.runs
        ]

    def means(self, number: int, held_out: bool) -> dict[str, float]:
        """Returns the means of a trial."""
        rows = self._rows[number, held_out]
        return means_of(self._runs.walked[rows], self._runs.values[rows], self.asked)

    def changes(self, number: int, held_out: bool) -> dict[str, dict[str, Any]]:
        """Returns the changes of metrics from before the optimisation to a trial, by name.

        They are computed as by `hexapod compare`, over pairs of runs of the same scenario, seed and
        control that both walked to the end.
        """
        before, after = self._rows[self.asked.trials, held_out], self._rows[number, held_out]
        walked = self._runs.walked[before] & self._runs.walked[after]
        pairs = np.stack([self._runs.values[before], self._runs.values[after]], axis=-1)[walked]
        return {
            name: change_of(name, [(a, b) for a, b in pairs[:, FIGURES.index(name)]]).as_table()
            for name in metric_names(self.asked)
            if name != WALKED
        }


def optimum_of(study: Study, store: Store, settings: Sequence[tuple[Any, ...]]) -> dict[str, Any]:
    """Returns the content of optimum.json of a study whose runs are all stored.

    settings: of settings_of_points().
    """
    parts = Parts(Runs(study, store), settings)
    names, kinds = [factor.name for factor in study.factors], {"training": False, "held_out": True}
    unchanged = parts.asked.trials  # the number of the settings before the optimisation

    def means(number: int) -> dict[str, dict[str, float]]:
        return {kind: parts.means(number, held_out) for kind, held_out in kinds.items()}

    best = [
        {
            "trial": trial.number,
            "values": dict(zip(names, trial.values, strict=True)),
            "feasible": trial.feasible,
            **means(trial.number),
            "change": {
                kind: parts.changes(trial.number, held_out) for kind, held_out in kinds.items()
            },
        }
        for trial in best_of(parts.trials(), parts.asked)
    ]
    asked = parts.asked
    return {
        "metrics": list(asked.metrics),
        "variables": names,
        "before": means(unchanged),
        "best": best,
    }


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
    places = np.linspace(0, len(front) - 1, min(asked.chosen, len(front))).round().astype(int)
    return [front[place] for place in np.unique(places).tolist()]


def _costs(trial: Trial, asked: Optimise) -> tuple[float, ...]:
    """Returns the metrics with the sign that makes less better, and the number for ties."""
    signed = (trial.means[name] * (1.0 if METRICS[name][1] else -1.0) for name in asked.metrics)
    return (*(math.inf if math.isnan(value) else value for value in signed), float(trial.number))


def _dominates(other: Trial, trial: Trial, asked: Optimise) -> bool:
    pairs = list(zip(_costs(other, asked)[:-1], _costs(trial, asked)[:-1], strict=True))
    return all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)
