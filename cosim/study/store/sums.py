"""Sums over sorted runs: of each point and of all runs, with one block of rows in memory.

A pair consists of two runs of the same point, scenario and seed, one under each control. In sorted
runs they are next to each other. A run whose partner is missing counts in the means of its control
and not in the changes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

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

# indices of the samples of pairs, which follow those of each control
BEFORE, AFTER, DIFFERENCE = -3, -2, -1


@dataclass(frozen=True, kw_only=True)
class Sums:
    """The sums of g groups of runs under c controls; a group is a point, or all runs."""

    runs: Numbers  # (g, c)
    walked: Numbers  # (g, c)
    pairs: Numbers  # (g,) pairs of which both runs walked to the end
    moments: Moments  # (g, c + 3, metrics) of walks: by control, then of pairs

    def __getitem__(self, place: slice) -> Sums:
        return Sums(
            runs=self.runs[place],
            walked=self.walked[place],
            pairs=self.pairs[place],
            moments=self.moments[place],
        )

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
        first = self._first_of_pairs()
        both = first & self._walked & np.append(self._walked[1:], False)
        figures = np.column_stack(
            [self.table[name].to_numpy(zero_copy_only=False).astype(np.float64) for name in FIGURES]
        )
        following = np.concatenate([figures[1:], figures[-1:]])
        values = np.stack(
            [*[figures] * self._size, figures, following, following - figures], axis=1
        )
        counted = np.column_stack([own & self._walked[:, None], both, both, both])
        paired = np.isfinite(figures) & np.isfinite(following)
        valid = counted[:, :, None] & np.stack(
            [*[np.isfinite(figures)] * self._size, paired, paired, paired], axis=1
        )
        return Sums(
            runs=np.add.reduceat(own, starts, axis=0, dtype=np.int64),
            walked=np.add.reduceat(own & self._walked[:, None], starts, axis=0, dtype=np.int64),
            pairs=np.add.reduceat(both, starts, dtype=np.int64),
            moments=moments_of(values, valid, starts),
        )

    def _first_of_pairs(self) -> Truths:
        """Returns which runs (n,) are followed by the same run under the second control."""
        case = pc.index_in(self.table["case"], value_set=pc.unique(self.table["case"])).to_numpy()
        same = self._size == 2
        for column in (self._point, case, self.table["seed"].to_numpy()):
            same = same & (column[1:] == column[:-1])
        return np.append(same & (self._control[:-1] == 0) & (self._control[1:] == 1), False)


def whole_pairs(tables: Iterable[pa.Table], controls: Sequence[str]) -> Iterator[pa.Table]:
    """Yields the same rows in tables that separate no pair."""
    left: pa.Table | None = None  # the last row of a table, when it may begin a pair
    for part in tables:
        table = part if left is None else pa.concat_tables([left, part])
        begins_pair = (
            len(controls) == 2
            and table.num_rows > 0
            and table["control"][-1].as_py() == controls[0]
        )
        kept = table.num_rows - begins_pair
        left = table.slice(kept) if begins_pair else None
        if kept:
            yield table.slice(0, kept)
    if left is not None:
        yield left


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
