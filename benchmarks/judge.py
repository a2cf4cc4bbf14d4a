"""Finds the setting of a method that meets an error over the whole family, and its cost."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from benchmarks.measure import Run
from benchmarks.series import Series


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Errors and real-time factors of one setting over the family."""

    setting: float
    error: float  # m    median
    worst_error: float
    realtime_factor: float  # median
    worst_realtime_factor: float


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A method and the setting with which it meets an error."""

    series: Series
    spread: Spread


def of_series(runs: Iterable[Run], series: Series) -> list[Run]:
    """Returns the runs of one method."""
    return [run for run in runs if (run.engine, run.method) == (series.engine, series.method)]


def spreads(runs: Sequence[Run], series: Series) -> list[Spread]:
    """Returns the spreads of the measured settings, from coarse to fine."""
    mine = of_series(runs, series)
    groups = [[run for run in mine if run.setting == setting] for setting in series.settings]
    return [_spread(group) for group in groups if group]


def _spread(group: Sequence[Run]) -> Spread:
    errors, factors = [run.error for run in group], [run.realtime_factor for run in group]
    return Spread(
        setting=group[0].setting, error=median(errors), worst_error=max(errors),
        realtime_factor=median(factors), worst_realtime_factor=min(factors),
    )  # fmt: skip


def choose(
    runs: Sequence[Run], series: Series, target: float, *, every_walk: bool
) -> Choice | None:
    """Returns the coarsest setting that meets an error [m], as all finer settings do too.

    The error is met in every walk, or in the median walk. One setting serves all walks, and a good
    setting between worse ones is not chosen, because both could be good by chance.
    """
    chosen = None
    for spread in reversed(spreads(runs, series)):
        if not (spread.worst_error if every_walk else spread.error) <= target:
            break
        chosen = spread
    return None if chosen is None else Choice(series=series, spread=chosen)


def best(
    runs: Sequence[Run], candidates: Iterable[Series], target: float, *, every_walk: bool = True
) -> Choice | None:
    """Returns the fastest of several methods that meet an error [m]."""
    found = [
        choice
        for series in candidates
        if (choice := choose(runs, series, target, every_walk=every_walk))
    ]
    return max(found, key=lambda choice: choice.spread.realtime_factor, default=None)


def agreement(runs: Sequence[Run], engine: str) -> float:
    """Returns the least median error of an engine to our converged paths [m].

    NaN if the engine has no runs.
    """
    groups: dict[tuple[str, float], list[float]] = {}
    for run in runs:
        if run.engine == engine and run.law == "plant":
            groups.setdefault((run.method, run.setting), []).append(run.error)
    return min((median(errors) for errors in groups.values()), default=math.nan)


def per_evaluation(runs: Iterable[Run], engine: str, law: str) -> float:
    """Returns the median time of one evaluation of the right-hand side [us], NaN if unknown."""
    times = [
        run.microseconds_per_evaluation for run in runs if (run.engine, run.law) == (engine, law)
    ]
    times = [value for value in times if math.isfinite(value)]
    return median(times) if times else math.nan
