"""Sums over sorted runs: of each point and of all runs, with one block of rows in memory.

A pair consists of two runs of the same point, scenario and seed: one under the first control, which
is the reference, and one under another control. In sorted runs all runs of a point, scenario and
seed follow each other in the order of the controls. A run whose partner is missing counts in the
means of its control and not in the changes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from hexapod_cosim.cosim.study.plan.records import Study
from hexapod_cosim.cosim.study.store.columns import FIGURES
from hexapod_cosim.cosim.study.store.moments import (
    Moments,
    Numbers,
    Truths,
    concatenated,
    moments_of,
)

SAMPLES = 3  # of a pair: the figures before and after, and their difference


@dataclass(frozen=True, kw_only=True)
class Sums:
    """The sums of g groups of runs under c controls; a group is a point, or all runs."""

    runs: Numbers  # (g, c)
    walked: Numbers  # (g, c)
    pairs: Numbers  # (g, c - 1) pairs of which both runs walked to the end, by the other control
    # (g, c + SAMPLES (c - 1), metrics) of walks: by control, then of pairs by the other control
    moments: Moments

    def __getitem__(self, place: slice) -> Sums:
        return Sums(
            runs=self.runs[place],
            walked=self.walked[place],
            pairs=self.pairs[place],
            moments=self.moments[place],
        )

    def of_pairs(self, other: int) -> tuple[Moments, Moments, Moments]:
        """Returns the moments (g, metrics) before, after and of the difference of pairs.

        other: number of the other control, from 1.
        """
        first = self.runs.shape[1] + SAMPLES * (other - 1)
        before, after, difference = (self.moments[:, first + k] for k in range(SAMPLES))
        return before, after, difference

    def merged(self, other: Sums) -> Sums:
        """Merges each group with the other one at the same place."""
        return Sums(
            runs=self.runs + other.runs,
            walked=self.walked + other.walked,
            pairs=self.pairs + other.pairs,
            moments=self.moments.merged(other.moments),
        )

    def concatenated(self, other: Sums) -> Sums:
        """Joins the groups of both."""
        counts = ((self.runs, other.runs), (self.walked, other.walked), (self.pairs, other.pairs))
        runs, walked, pairs = (np.concatenate(pair) for pair in counts)
        return Sums(
            runs=runs, walked=walked, pairs=pairs, moments=concatenated(self.moments, other.moments)
        )


@dataclass(frozen=True, kw_only=True)
class Block:
    """Successive points, all of whose runs are in the sums."""

    first: pa.Table  # the first row of each point, for its settings
    held_out: Truths  # (g,) whether the runs are held out from the optimiser
    sums: Sums


class Rows:
    """The runs of a sorted table as arrays."""

    def __init__(self, table: pa.Table, study: Study) -> None:
        self.table, self._size = table, len(study.run_controls)
        self._control = pc.index_in(
            table["control"], value_set=pa.array(study.run_controls)
        ).to_numpy()
        self._walked = table["walked"].to_numpy()
        self._point = table["point"].to_numpy()
        self.held_out = np.zeros(len(self._point), dtype=np.bool_)
        if study.optimise is not None:
            self.held_out = np.isin(table["seed"].to_numpy(), list(study.optimise.held_out.seeds))

    def starts(self) -> Numbers:
        """Returns the indices (g,) where a point begins, or the held-out part of a point."""
        new = (self._point[1:] != self._point[:-1]) | (self.held_out[1:] != self.held_out[:-1])
        return np.append(0, 1 + np.flatnonzero(new))

    def sums(self, starts: Numbers) -> Sums:
        """Returns the sums of groups of successive runs that begin at `starts` (g,)."""
        own = self._control[:, None] == np.arange(self._size)
        reference = self._references()
        paired = (reference >= 0) & self._walked & self._walked[reference]
        both = own[:, 1:] & paired[:, None]
        figures = np.column_stack(
            [self.table[name].to_numpy(zero_copy_only=False).astype(np.float64) for name in FIGURES]
        )
        before, others = figures[reference], self._size - 1
        samples = [before, figures, figures - before]
        values = np.stack([*[figures] * self._size, *samples * others], axis=1)
        counted = np.column_stack([own & self._walked[:, None], np.repeat(both, SAMPLES, axis=1)])
        known = np.isfinite(figures)
        known_pairs = known & np.isfinite(before)
        valid = counted[:, :, None] & np.stack(
            [*[known] * self._size, *[known_pairs] * (SAMPLES * others)], axis=1
        )
        return Sums(
            runs=np.add.reduceat(own, starts, axis=0, dtype=np.int64),
            walked=np.add.reduceat(own & self._walked[:, None], starts, axis=0, dtype=np.int64),
            pairs=np.add.reduceat(both, starts, axis=0, dtype=np.int64),
            moments=moments_of(values, valid, starts),
        )

    def _references(self) -> Numbers:
        """Returns the index (n,) of each run's partner under the first control; -1 without one."""
        count = len(self._control)
        case = pc.index_in(self.table["case"], value_set=pc.unique(self.table["case"])).to_numpy()
        new = np.arange(count) == 0
        for column in (self._point, case, self.table["seed"].to_numpy()):
            new[1:] |= column[1:] != column[:-1]
        first = np.maximum.accumulate(np.where(new, np.arange(count), 0))
        return np.where((self._control[first] == 0) & (self._control > 0), first, -1)


def whole_pairs(tables: Iterable[pa.Table], controls: Sequence[str]) -> Iterator[pa.Table]:
    """Yields the same rows in tables that separate no pair."""
    left: pa.Table | None = None  # the last rows of a table, when others may belong to them
    for part in tables:
        table = part if left is None else pa.concat_tables([left, part])
        kept = table.num_rows - _unfinished(table, controls)
        left = table.slice(kept) if kept < table.num_rows else None
        if kept:
            yield table.slice(0, kept)
    if left is not None:
        yield left


def _unfinished(table: pa.Table, controls: Sequence[str]) -> int:
    """Returns the number of last rows that may have partners in the next table."""
    if len(controls) < 2 or not table.num_rows or table["control"][-1].as_py() == controls[-1]:
        return 0
    last = table.slice(max(table.num_rows - len(controls), 0))
    keys = last.select(["point", "case", "seed"]).to_pylist()
    return sum(1 for _ in takewhile(lambda key: key == keys[-1], reversed(keys)))


def blocks_of(parts: Iterable[Rows]) -> Iterator[Block]:
    """Yields blocks of the points of sorted runs."""
    last: Block | None = None  # the last point, which may go on in the next table
    for rows in parts:
        starts = rows.starts()
        block = _joined(
            last,
            Block(
                first=rows.table.take(starts),
                held_out=rows.held_out[starts],
                sums=rows.sums(starts),
            ),
        )
        count = len(block.held_out)
        if count > 1:
            yield _cut(block, slice(0, count - 1))
        last = _cut(block, slice(count - 1, count))
    if last is not None:
        yield last


def _cut(block: Block, place: slice) -> Block:
    """Returns some of a block's points."""
    table = block.first.slice(place.start, place.stop - place.start)
    return Block(first=table, held_out=block.held_out[place], sums=block.sums[place])


def _joined(left: Block | None, right: Block) -> Block:
    """Joins a single point and a block; merges their points when they are the same."""
    if left is None:
        return right
    if left.first["point"][0] == right.first["point"][0] and left.held_out[0] == right.held_out[0]:
        same, rest = _cut(right, slice(0, 1)), _cut(right, slice(1, len(right.held_out)))
        left, right = (
            Block(first=left.first, held_out=left.held_out, sums=left.sums.merged(same.sums)),
            rest,
        )
    return Block(
        first=pa.concat_tables([left.first, right.first]),
        held_out=np.concatenate([left.held_out, right.held_out]),
        sums=left.sums.concatenated(right.sums),
    )
