"""Groups the runs of a study by point and control, in SQL, some thousand runs at a time.

Means are over the runs that walked to the end; metrics of runs in which the robot fell are in
results.parquet only. A pair consists of two runs of the same point, scenario and seed: one under
the first control, which is the reference, and one under another control. A run whose partner is
missing counts in the means of its control and not in the changes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.extensions.study.moments import (
    SAMPLES,
    Figures,
    Moments,
    Numbers,
    Sums,
    figures_of,
    merged,
)
from hexapod_cosim.extensions.study.records import SCENARIO_FACTOR, Study
from hexapod_cosim.extensions.study.runs import count_runs
from hexapod_cosim.extensions.study.store import FIGURES, ROWS_AT_ONCE, Store, quoted

MAX_POINTS = 4000  # kept for figures and tables; evenly chosen if there are more
BY = "point, held_out, control"  # the columns that groups differ by
Rows = list[tuple[Any, ...]]


@dataclass(frozen=True, kw_only=True)
class Point:
    """The results of a point."""

    number: int
    case: str
    values: Mapping[str, Any]  # by factor
    held_out: bool  # from the optimiser
    figures: Figures


class Groups:
    """Computes the figures of all points and of all runs."""

    def __init__(self, study: Study, store: Store) -> None:
        self._study, self._store, self._controls = study, store, study.controls
        self._sums: Sums | None = None  # of all runs
        self._step = _point_step(study, store.select("SELECT count(*) FROM runs")[0][0])
        self.points: list[Point] = []  # every step-th one
        self.count = 0  # of all points

    @property
    def overall(self) -> Figures:
        """The figures of all blocks that were computed; at least one."""
        assert self._sums is not None
        return figures_of(self._sums, self._controls)[0]

    def blocks(self) -> Iterator[list[Point]]:
        """Yields the points, some at a time, in the order of their runs."""
        for begin, end in _ranges(self._study):
            points, sums = self._block(begin, end)
            self._sums = merged([sums] if self._sums is None else [self._sums, sums])
            self.count += len(points)
            self.points += [point for point in points if point.number % self._step == 0]
            if points:
                yield points

    def _block(self, begin: int, end: int) -> tuple[list[Point], Sums]:
        """Returns the points whose runs are from `begin` to before `end`, and their sums."""
        study = self._study
        names = ["case" if f.name == SCENARIO_FACTOR else f.name for f in study.factors]
        columns = ", ".join(map(quoted, ["case", *names]))
        # the settings of a point are those of its first run
        rows = self._store.select(
            f"SELECT point, {_held_out(study)} AS held_out, min(run), {columns} FROM runs"
            f" WHERE run >= {begin} AND run < {end}"
            " GROUP BY point, held_out ORDER BY min(run)"
        )
        places = {row[:2]: place for place, row in enumerate(rows)}
        sums = self._group_sums(begin, end, places)
        found = figures_of(sums, self._controls)
        keys = [factor.name for factor in study.factors]
        points = [
            Point(
                number=number,
                held_out=bool(held_out),
                case=case,
                values=dict(zip(keys, values, strict=True)),
                figures=figures,
            )
            for (number, held_out, _, case, *values), figures in zip(rows, found, strict=True)
        ]
        return points, sums

    def _group_sums(self, begin: int, end: int, places: Mapping[tuple[Any, ...], int]) -> Sums:
        """Returns the sums of the runs from `begin` to before `end`.

        places: index of each group by point and whether it is held out.
        """
        controls, size = self._controls, len(FIGURES)
        keys = f"point, {_held_out(self._study)} AS held_out, control"
        source = f"FROM runs WHERE run >= {begin} AND run < {end}"
        figures = ", ".join(map(quoted, FIGURES))
        walks = f"SELECT {keys}, {figures} {source} AND walked"
        total = self._store.select(f"SELECT {keys}, count(*) {source} GROUP BY {BY}")
        walked = self._store.select(moments_query(walks, FIGURES))
        paired: Rows = []
        for k in range(1, len(controls)):
            pairs, names = pairs_query(k, len(controls), begin, end)
            paired += self._store.select(moments_query(pairs, names))
        numbers, _ = _filled(total, places, controls, 0)
        of_walks, means = _filled(walked, places, controls, size)
        of_pairs, changes = _filled(paired, places, controls[1:], SAMPLES * size)
        shape = (*of_pairs.shape, SAMPLES, size)
        changes = Moments(*(part.reshape(shape) for part in vars(changes).values()))
        return Sums(runs=numbers, walked=of_walks, pairs=of_pairs, means=means, changes=changes)


def _held_out(study: Study) -> str:
    """Returns the SQL expression for whether a run is held out from the optimiser."""
    return "0" if study.optimise is None else f"run >= {study.optimise.trained}"


def _ranges(study: Study) -> Iterator[tuple[int, int]]:
    """Yields ranges of run numbers with whole points; one at least."""
    asked, count = study.optimise, count_runs(study)
    if asked is None:
        parts = [(0, count, len(study.seeds) * len(study.controls))]
    else:
        parts = [
            (0, asked.trained, asked.training.runs),
            (asked.trained, count, asked.held_out.runs),
        ]
    for first, end, runs_of_point in parts:
        step = runs_of_point * max(ROWS_AT_ONCE // runs_of_point, 1)
        yield from ((begin, min(begin + step, end)) for begin in range(first, end, step))


def pairs_query(k: int, controls: int, begin: int, end: int) -> tuple[str, list[str]]:
    """Returns the SQL of the pairs with the control number `k`, from 1, and its columns.

    The numbers of the runs of a pair differ by `k`. A metric that one of both runs lacks is NULL.
    """
    names = [f"{sample} {name}" for sample in ("before", "after", "change") for name in FIGURES]
    one, other = ([f"{table}.{quoted(name)}" for name in FIGURES] for table in ("a", "b"))
    before = [f"iif({b} IS NULL, NULL, {a})" for a, b in zip(one, other, strict=True)]
    after = [f"iif({a} IS NULL, NULL, {b})" for a, b in zip(one, other, strict=True)]
    change = [f"{b} - {a}" for a, b in zip(one, other, strict=True)]
    values = zip([*before, *after, *change], names, strict=True)
    columns = ", ".join(f"{value} AS {quoted(name)}" for value, name in values)
    text = (
        f"SELECT a.point, 0 AS held_out, b.control, {columns} FROM runs a JOIN runs b"
        f" ON b.run = a.run + {k} WHERE a.run % {controls} = 0 AND a.walked AND b.walked"
        f" AND a.run >= {begin} AND a.run < {end}"
    )
    return text, names


def moments_query(source: str, names: Sequence[str]) -> str:
    """Returns SQL that groups the rows of a query.

    It gives the number of rows of each group and, for each of the columns `names`, the number of
    values, their mean and the sum of squared deviations from it.
    """
    pairs = [(quoted(name), quoted(f"mean {name}")) for name in names]
    means = ", ".join(f"avg({value}) OVER same AS {mean}" for value, mean in pairs)
    apart = [f"({value} - {mean})" for value, mean in pairs]
    moments = ", ".join(
        f"count({value}), coalesce(max({mean}), 0.0), total({one} * {one})"
        for (value, mean), one in zip(pairs, apart, strict=True)
    )
    return (
        f"SELECT {BY}, count(*), {moments} FROM"
        f" (SELECT *, {means} FROM ({source}) WINDOW same AS (PARTITION BY {BY})) GROUP BY {BY}"
    )


def _filled(
    rows: Rows, places: Mapping[tuple[Any, ...], int], controls: Sequence[str], size: int
) -> tuple[Numbers, Moments]:
    """Returns the numbers of rows (g, c) and the moments (g, c, size) that a query has grouped."""
    numbers = np.zeros((len(places), len(controls)), dtype=np.int64)
    moments = np.zeros((3, *numbers.shape, size))
    for point, held_out, control, number, *values in rows:
        group, place = places[point, held_out], controls.index(control)
        numbers[group, place] = number
        moments[:, group, place] = np.reshape(values, (size, 3)).T
    return numbers, Moments(*moments)


def _point_step(study: Study, runs: int) -> int:
    """Returns every how many points one is kept, for a study of a number of runs."""
    if study.optimise is not None:
        return 1
    points = runs / (len(study.seeds) * len(study.controls))
    return max(math.ceil(points / MAX_POINTS), 1)
