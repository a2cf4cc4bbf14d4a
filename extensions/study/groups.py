"""Groups the runs of a study by point and control, and computes the figures of each group.

Means are over the runs that walked to the end; metrics of runs in which the robot fell are in
results.parquet only. A pair consists of two runs of the same point, scenario and seed: one under
the first control, which is the reference, and one under another control. A run whose partner is
missing counts in the means of its control and not in the changes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.comparison import Change, half_widths, log_half_widths, verdicts
from hexapod_cosim.cosim.results.metrics import FLOORS
from hexapod_cosim.extensions.study.records import SCENARIO_FACTOR, Study
from hexapod_cosim.extensions.study.store import FIGURES, Store, quoted

Array = NDArray[np.float64]
LAST = 2**62  # larger than the number of any run
SAMPLES = ("before", "after", "change")  # of a pair


@dataclass(frozen=True)
class Mean:
    """The mean of a metric over walks."""

    value: float  # NaN where no walk has the metric
    half_width: float  # of its 95 % interval; NaN for fewer than two walks
    runs: int


@dataclass(frozen=True, kw_only=True)
class Figures:
    """The figures of a group of runs."""

    runs: Mapping[str, int]  # numbers of runs by control
    walked: Mapping[str, int]  # numbers of walks by control
    # numbers of pairs with the first control, of which both runs walked to the end, by the other
    pairs: Mapping[str, int]
    means: Mapping[str, Mapping[str, Mean]]  # by control and metric
    # from the first control to each other one, by the other one and metric
    changes: Mapping[str, Mapping[str, Change]]


@dataclass(frozen=True, kw_only=True)
class Point:
    """The results of a point."""

    number: int
    case: str
    values: Mapping[str, Any]  # by factor
    held_out: bool  # from the optimiser
    figures: Figures


@dataclass(frozen=True)
class Moments:
    """The moments of samples, one for each group and metric."""

    count: Array
    mean: Array  # NaN of an empty sample
    square: Array  # sum of squared deviations from the mean

    @cached_property
    def half_width(self) -> Array:
        """Half widths of Student's 95 % intervals, NaN for fewer than two values."""
        return half_widths(self.count, self.square)


def moments_of(values: Array, starts: Sequence[int]) -> Moments:
    """Returns the moments (g, m) of values (n, m), without those that are NaN.

    starts: (g,) first row of each group.
    """
    if not len(values):
        empty = np.zeros((len(starts), values.shape[1]))
        return Moments(empty, np.full_like(empty, math.nan), empty)
    known = np.isfinite(values)
    count = np.add.reduceat(known.astype(float), starts)
    mean = np.add.reduceat(np.where(known, values, 0.0), starts) / np.where(count, count, math.nan)
    apart = values - np.repeat(mean, np.diff([*starts, len(values)]), axis=0)
    return Moments(count, mean, np.add.reduceat(np.where(known, apart, 0.0) ** 2, starts))


class Runs:
    """The stored runs of a study, in the order of their numbers, as arrays.

    The runs of a group follow each other: those of a point are numbered one after the other, and
    the held-out runs of an optimisation after all others.
    """

    def __init__(self, study: Study, store: Store, *, first: int = 0, end: int = LAST) -> None:
        self.study, controls = study, study.controls
        names = ", ".join(map(quoted, FIGURES))
        rows = store.select(
            f"SELECT run, point, control, walked, {names} FROM runs"
            " WHERE run >= ? AND run < ? ORDER BY run",
            (first, end),
        )
        self.number = np.array([row[0] for row in rows], dtype=np.int64)
        self.point = np.array([row[1] for row in rows], dtype=np.int64)
        self.control = np.array([controls.index(row[2]) for row in rows], dtype=np.int64)
        self.walked = np.array([row[3] for row in rows], dtype=np.bool_)
        self.values = np.array([row[4:] for row in rows], dtype=float).reshape(-1, len(FIGURES))
        self.held_out = self.number >= _first_held_out(study)

    def starts(self) -> list[int]:
        """Returns the first row of each point."""
        keys = np.stack([self.point, self.held_out])
        differ = np.any(keys[:, 1:] != keys[:, :-1], axis=0)
        return [0, *(np.flatnonzero(differ) + 1).tolist()] if len(self.number) else []

    def of(self, control: int) -> Array:
        """Returns the metrics (n, m) of the walks under a control, NaN in all other rows."""
        return np.where((self.walked & (self.control == control))[:, None], self.values, math.nan)

    def pairs(self, other: int) -> tuple[NDArray[np.bool_], Array, Array]:
        """Returns which rows are the first of a pair (n,), and the metrics of both runs (n, m).

        The numbers of the runs of a pair differ by `other`, the place of the other control.
        """
        partner = np.searchsorted(self.number, self.number + other)
        there = partner < len(self.number)
        partner = np.where(there, partner, 0)
        paired = (
            (self.number[partner] == self.number + other)
            & (self.control == 0)
            & (self.walked & self.walked[partner] & there)
        )
        values, partners = self.values, self.values[partner]
        known = paired[:, None] & np.isfinite(values) & np.isfinite(partners)
        return paired, np.where(known, values, math.nan), np.where(known, partners, math.nan)


@dataclass(frozen=True, kw_only=True)
class ControlGroups:
    """The runs of groups under a control."""

    runs: NDArray[np.int64]  # (g,)
    walked: NDArray[np.int64]  # (g,)
    means: Moments  # (g, m)


@dataclass(frozen=True, kw_only=True)
class PairGroups:
    """The pairs of groups with a control other than the first."""

    pairs: NDArray[np.int64]  # (g,)
    samples: Mapping[str, Moments]  # (g, m) by SAMPLES
    log_half_width: Array  # (g, m)
    verdict: NDArray[np.str_]  # (g, m)

    def change(self, group: int, metric: int) -> Change:
        """Returns the change of a metric in a group."""
        before, after, change = (self.samples[name] for name in SAMPLES)
        return Change(
            before=float(before.mean[group, metric]),
            after=float(after.mean[group, metric]),
            half_width=float(change.half_width[group, metric]),
            log_half_width=float(self.log_half_width[group, metric]),
            pairs=int(change.count[group, metric]),
            floor=FLOORS[FIGURES[metric]],
            verdict=str(self.verdict[group, metric]),
        )


class Groups:
    """The figures of groups of runs.

    Args:
        starts: first row of each group in `runs`; by default there is one group.
    """

    def __init__(self, runs: Runs, starts: Sequence[int] = (0,)) -> None:
        self.controls = runs.study.controls
        self._runs, self.starts = runs, starts
        self.by_control = {name: self._control(k) for k, name in enumerate(self.controls)}
        self.changes = {name: self._pairs(k) for k, name in enumerate(self.controls) if k}

    def figures(self, group: int) -> Figures:
        """Returns the figures of a group, given its number."""
        found, changes = self.by_control, self.changes
        return Figures(
            runs={name: int(item.runs[group]) for name, item in found.items()},
            walked={name: int(item.walked[group]) for name, item in found.items()},
            pairs={name: int(item.pairs[group]) for name, item in changes.items()},
            means={name: _means(item.means, group) for name, item in found.items()},
            changes={
                name: {metric: item.change(group, k) for k, metric in enumerate(FIGURES)}
                for name, item in changes.items()
            },
        )

    def _count(self, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Returns the numbers (g,) of chosen rows (n,)."""
        if not len(chosen):
            return np.zeros(len(self.starts), dtype=np.int64)
        return np.asarray(np.add.reduceat(chosen.astype(np.int64), self.starts))

    def _control(self, control: int) -> ControlGroups:
        runs = self._runs
        own = runs.control == control
        return ControlGroups(
            runs=self._count(own),
            walked=self._count(own & runs.walked),
            means=moments_of(runs.of(control), self.starts),
        )

    def _pairs(self, control: int) -> PairGroups:
        paired, before, after = self._runs.pairs(control)
        values = zip(SAMPLES, (before, after, after - before), strict=True)
        samples = {name: moments_of(one, self.starts) for name, one in values}
        first, second, change = samples.values()
        squares = (first.square, second.square, change.square)
        log_half = log_half_widths(change.count, first.mean, second.mean, squares)
        parts = (first.mean, second.mean, change.half_width, log_half)
        verdict = [
            verdicts(name, *(part[:, k] for part in parts)) for k, name in enumerate(FIGURES)
        ]
        return PairGroups(
            pairs=self._count(paired),
            samples=samples,
            log_half_width=log_half,
            verdict=np.stack(verdict, axis=1),
        )


def _means(moments: Moments, group: int) -> dict[str, Mean]:
    """Returns the means of a group by metric."""
    parts = (moments.mean[group], moments.half_width[group], moments.count[group].astype(int))
    values = zip(FIGURES, *(part.tolist() for part in parts), strict=True)
    return {name: Mean(*figures) for name, *figures in values}


def _first_held_out(study: Study) -> int:
    """Returns the number of the first run that is held out from the optimiser."""
    return LAST if study.optimise is None else study.optimise.trained


def settings_of_points(study: Study, store: Store) -> list[tuple[Any, ...]]:
    """Returns scenario and values of the factors of each point, in the order of their runs."""
    names = ["case" if f.name == SCENARIO_FACTOR else f.name for f in study.factors]
    rows = store.select(
        f"SELECT {', '.join(map(quoted, ['case', *names]))}, min(run) FROM runs"
        " GROUP BY point, run >= ? ORDER BY min(run)",
        (_first_held_out(study),),
    )
    return [row[:-1] for row in rows]


def points_of(
    runs: Runs, groups: Groups, settings: Sequence[tuple[Any, ...]], *, most: int
) -> list[Point]:
    """Returns at most `most` points, evenly chosen, in the order of their runs.

    groups: of all points; settings: of settings_of_points().
    """
    names = [factor.name for factor in runs.study.factors]
    step = max(math.ceil(len(settings) / most), 1)
    return [
        Point(
            number=int(runs.point[groups.starts[place]]),
            case=settings[place][0],
            values=dict(zip(names, settings[place][1:], strict=True)),
            held_out=bool(runs.held_out[groups.starts[place]]),
            figures=groups.figures(place),
        )
        for place in range(0, len(settings), step)
    ]
