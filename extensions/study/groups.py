"""The figures of a group of runs: all runs of a study, or those of a point.

Means are over the runs that walked to the end; metrics of runs in which the robot fell are in
results.parquet only. A pair consists of two runs of the same point, scenario and seed: one under
the first control, which is the reference, and one under another control. A run whose partner is
missing counts in the means of its control and not in the changes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.comparison import Change, change_of, half_width_of
from hexapod_cosim.extensions.study.records import SCENARIO_FACTOR, Study
from hexapod_cosim.extensions.study.store import FIGURES, Store, quoted

Array = NDArray[np.float64]
LAST = 2**62  # larger than the number of any run
ALL_RUNS = slice(None)


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


class Runs:
    """The stored runs of a study, in the order of their numbers, as arrays.

    Args:
        first, end: numbers of the first run and of the run after the last.
    """

    def __init__(self, study: Study, store: Store, *, first: int = 0, end: int = LAST) -> None:
        self.study = study
        names = ", ".join(map(quoted, FIGURES))
        rows = store.select(
            f"SELECT run, point, control, walked, {names} FROM runs"
            " WHERE run >= ? AND run < ? ORDER BY run",
            (first, end),
        )
        self.number = np.array([row[0] for row in rows], dtype=np.int64)
        self.point = np.array([row[1] for row in rows], dtype=np.int64)
        self.control = np.array([study.controls.index(row[2]) for row in rows], dtype=np.int64)
        self.walked = np.array([row[3] for row in rows], dtype=np.bool_)
        self.values = np.array([row[4:] for row in rows], dtype=float).reshape(-1, len(FIGURES))
        self.held_out = self.number >= _first_held_out(study)

    def groups(self) -> dict[tuple[int, bool], slice]:
        """Returns the rows of each point, by its number and whether it is held out.

        They follow each other: those of a point are numbered one after the other, and the held-out
        runs of an optimisation after all others.
        """
        keys = np.stack([self.point, self.held_out])
        differ = np.flatnonzero(np.any(keys[:, 1:] != keys[:, :-1], axis=0)) + 1
        starts = [0, *differ.tolist()] if len(self.number) else []
        ends = [*starts[1:], len(self.number)]
        return {
            (int(self.point[start]), bool(self.held_out[start])): slice(start, end)
            for start, end in zip(starts, ends, strict=True)
        }

    def figures(self, rows: slice = ALL_RUNS, names: Sequence[str] = FIGURES) -> Figures:
        """Returns the figures of some rows, of the metrics `names`."""
        controls, places = self.study.controls, [FIGURES.index(name) for name in names]
        control, walked, values = self.control[rows], self.walked[rows], self.values[rows]
        own = {name: control == k for k, name in enumerate(controls)}
        pairs = {name: self._pairs(rows, k) for k, name in enumerate(controls) if k}
        return Figures(
            runs={name: int(chosen.sum()) for name, chosen in own.items()},
            walked={name: int((chosen & walked).sum()) for name, chosen in own.items()},
            pairs={name: len(found) for name, found in pairs.items()},
            means={
                name: {FIGURES[k]: mean_of(values[chosen & walked, k]) for k in places}
                for name, chosen in own.items()
            },
            changes={
                name: {FIGURES[k]: change_of(FIGURES[k], found[..., k]) for k in places}
                for name, found in pairs.items()
            },
        )

    def _pairs(self, rows: slice, other: int) -> Array:
        """Returns the metrics (pairs, 2, metrics) of the pairs with a control of which both walked.

        The numbers of the runs of a pair differ by `other`, the place of the other control.
        """
        walks = np.flatnonzero(self.walked[rows]) + (rows.start or 0)
        control, number = self.control[walks], self.number[walks]
        one, two = walks[control == 0], walks[control == other]
        _, first, second = np.intersect1d(
            number[control == 0] + other, number[control == other], return_indices=True
        )
        return np.stack([self.values[one[first]], self.values[two[second]]], axis=1)


def mean_of(values: Array) -> Mean:
    """Returns the mean of values, without those that are NaN."""
    known = values[np.isfinite(values)]
    value = float(known.mean()) if len(known) else math.nan
    return Mean(value, half_width_of(known), len(known))


def _first_held_out(study: Study) -> int:
    """Returns the number of the first run that is held out from the optimiser."""
    return LAST if study.optimise is None else study.optimise.trained


def points_of(
    runs: Runs, store: Store, *, names: Sequence[str] = FIGURES, most: int = LAST
) -> tuple[list[Point], int]:
    """Returns at most `most` points, evenly chosen, in the order of their runs, and their number.

    names: metrics of their figures.
    """
    study, groups = runs.study, runs.groups()
    columns = ["case" if f.name == SCENARIO_FACTOR else f.name for f in study.factors]
    settings = store.select(
        f"SELECT {', '.join(map(quoted, ['case', *columns]))}, min(run) FROM runs"
        " GROUP BY point, run >= ? ORDER BY min(run)",
        (_first_held_out(study),),
    )
    step = max(math.ceil(len(groups) / most), 1)
    keys = [factor.name for factor in study.factors]
    points = [
        Point(
            number=number,
            case=case,
            values=dict(zip(keys, values, strict=True)),
            held_out=held_out,
            figures=runs.figures(rows, names),
        )
        for ((number, held_out), rows), (case, *values, _) in list(
            zip(groups.items(), settings, strict=True)
        )[::step]
    ]
    return points, len(groups)
