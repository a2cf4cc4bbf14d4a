"""From runs to the figures that are compared: which setting of a method meets an error over the
whole family, and what it costs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from benchmarks.measure import Run
from benchmarks.series import Series


@dataclass(frozen=True, kw_only=True)
class Spread:
    """One setting over the family."""

    setting: float
    error: float  # m    median
    worst_error: float
    realtime_factor: float  # median
    worst_realtime_factor: float


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A method at the setting that meets an error."""

    series: Series
    spread: Spread


def of_series(runs: Iterable[Run], series: Series) -> list[Run]:
    """The runs of one method."""
    return [run for run in runs if (run.engine, run.method) == (series.engine, series.method)]


def spreads(runs: Sequence[Run], series: Series) -> list[Spread]:
    """Coarse to fine; settings that were not measured are left out."""
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
    """The coarsest setting that meets an error [m] in every walk, or in the median walk, as all
    finer ones do too.

    One setting for all walks, and no setting that looks good between worse ones: neither may be
    picked by luck.
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
    """The fastest of several methods at an error."""
    found = [
        choice
        for series in candidates
        if (choice := choose(runs, series, target, every_walk=every_walk))
    ]
    return max(found, key=lambda choice: choice.spread.realtime_factor, default=None)


def agreement(runs: Sequence[Run], engine: str) -> float:
    """m    how close an engine came to our converged paths: over its settings, the least median
    error. NaN: it never ran.
    """
    groups: dict[tuple[str, float], list[float]] = {}
    for run in runs:
        if run.engine == engine and run.law == "plant":
            groups.setdefault((run.method, run.setting), []).append(run.error)
    return min((median(errors) for errors in groups.values()), default=math.nan)


def per_evaluation(runs: Iterable[Run], engine: str, law: str) -> float:
    """us    median time of one evaluation of the right-hand side; NaN when no driver told."""
    told = [
        run.microseconds_per_evaluation for run in runs if (run.engine, run.law) == (engine, law)
    ]
    told = [value for value in told if math.isfinite(value)]
    return median(told) if told else math.nan
