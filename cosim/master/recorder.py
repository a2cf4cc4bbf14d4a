"""Records the rows of a run, one per macro-step or fewer, into arrays allocated beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import (
    JOINTS,
    LEGS,
    foot_names,
    foot_vector_names,
    joint_names,
    vector_names,
)
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.models import HexapodError, ScenarioError, suggestion
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import check_type

BLOCK_ROWS = 500  # that are stored at once
PEAKS = ("peak_force", "peak_force_rate")  # of a foot, within the last communication step
LANDING_RATE, LANDINGS = "landing_rate", "landings"
COMMAND_COLUMNS = (
    "command.vx",
    "command.vy",
    "command.yaw_rate",
    "command.height",
    "command.roll",
    "command.pitch",
)


class ColumnError(HexapodError):
    """A variable was asked for that was not recorded."""


@dataclass(frozen=True)
class Recording:
    """Rows of a run.

    Row k holds the outputs read at time[k] and the inputs set then, which hold until time[k + 1].
    """

    names: tuple[str, ...]  # the first is "time" [s]
    data: Array  # (rows, names)
    _index: Mapping[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_index", _index_of(self.names))

    @property
    def time(self) -> Array:
        """Times (rows,) [s]."""
        return self.data[:, 0]

    def column(self, name: str) -> Array:
        """Returns one variable (rows,). Raises ColumnError when it was not recorded."""
        return self.columns([name])[:, 0]

    def columns(self, names: Sequence[str]) -> Array:
        """Returns several variables (rows, names). Raises ColumnError for one not recorded.

        Those that adjoin in memory are returned as a view that cannot be written.
        """
        for name in names:
            check_type(name, str, "the name of a column", where="column", error=ColumnError)
            if name not in self._index:
                otherwise = "record it: outputs.csv names the columns that are kept"
                fix = suggestion(name, self.names, otherwise=otherwise)
                raise ColumnError("no such column in the recording", got=name, fix=fix)
        places = [self._index[name] for name in names]
        adjoin = bool(places) and places == list(range(places[0], places[0] + len(places)))
        if not adjoin or self.data.strides[0] != self.data.itemsize:
            return self.data[:, places]
        view = self.data[:, places[0] : places[-1] + 1]
        view.flags.writeable = False
        return view

    def joints(self, quantity: str) -> Array:
        """Returns a quantity of all joints (rows, 6, 3)."""
        return self.columns(joint_names(quantity)).reshape(-1, LEGS, JOINTS)

    def feet(self, quantity: str) -> Array:
        """Returns a scalar quantity of all feet (rows, 6)."""
        return self.columns(foot_names(quantity))

    def foot_vectors(self, quantity: str) -> Array:
        """Returns a vector quantity of all feet (rows, 6, 3), world axes."""
        return self.columns(foot_vector_names(quantity)).reshape(-1, LEGS, 3)

    def vector(self, stem: str, size: int = 3) -> Array:
        """Returns a vector variable (rows, size)."""
        return self.columns(vector_names(stem, size))

    def rows(self, chosen: slice) -> Recording:
        """Returns the same columns of fewer rows, without copying."""
        return Recording(self.names, self.data[chosen])

    def chosen(self, patterns: Sequence[str]) -> Recording:
        """Returns time and the columns that match a pattern (`*` matches any text).

        Raises ScenarioError when a pattern matches nothing.
        """
        keep = chosen_columns(self.names, patterns)
        if len(keep) == len(self.names):
            return self
        return Recording(tuple(self.names[k] for k in keep), self.data[:, keep])


@lru_cache(maxsize=64)
def _index_of(names: tuple[str, ...]) -> Mapping[str, int]:
    """Returns the place of each column; recordings of the same columns share the mapping."""
    return {name: k for k, name in enumerate(names)}


def chosen_columns(
    names: Sequence[str], patterns: Sequence[str], *, where: str = "outputs.csv"
) -> list[int]:
    """Returns the indices of time and of the names that match a pattern (`*` matches any text).

    Raises ScenarioError when a pattern matches nothing.
    """
    for pattern in patterns:
        if not any(_matches(name, pattern) for name in names):
            fix = suggestion(pattern, names, otherwise="`fmpy info` lists the names")
            raise ScenarioError("no output has this name", got=pattern, fix=fix, where=where)
    return [
        k
        for k, name in enumerate(names)
        if k == 0 or any(_matches(name, pattern) for pattern in patterns)
    ]


def _matches(name: str, pattern: str) -> bool:
    return fnmatchcase(name, pattern.replace("[", "[[]"))  # brackets in our names mean an index


class Rows:
    """Stores the rows of a run; times (rows,) and body commands (rows, 6) are known before.

    A loop writes rows of `names` to `room` and calls `store`. With `every` > 1 only the first,
    every `every`-th and the last row are kept; then `judged` names the columns that are kept of all
    rows, and the plant's peaks in a kept row are the largest since the kept row before.
    """

    def __init__(
        self,
        names: Sequence[str],
        times: Array,
        commands: Array,
        *,
        every: int = 1,
        judged: Sequence[str] = (),
    ) -> None:
        moments = kept_moments(len(times), every)
        self._kept = _table(names, times[moments], commands[moments])
        self._judged = self._kept
        self._block = np.zeros((BLOCK_ROWS + every, len(names)))
        self._count = self._kept_count = self._left = 0  # rows; those after the last kept one
        if every > 1:
            self._judged_places = [k for k, name in enumerate(names) if name in set(judged)]
            columns = [names[k] for k in self._judged_places]
            self._judged = _table(columns, times, commands)
            self._due, self._peaks = set(moments.tolist()), Peaks(names)

    @property
    def room(self) -> Array:
        """Where the next rows are written (at least BLOCK_ROWS, names)."""
        return self._block[self._left :]

    def store(self, count: int) -> None:
        """Takes over the first `count` rows of the room."""
        fresh, first = self.room[:count], self._count
        self._count += count
        if self._judged is self._kept:
            self._kept.data[first : self._count, 1 : 1 + fresh.shape[1]] = fresh
            self._kept_count = self._count
            return
        places = self._judged_places
        self._judged.data[first : self._count, 1 : 1 + len(places)] = fresh[:, places]
        self._thin(self._block[: self._left + count], first - self._left)

    def _thin(self, rows: Array, first: int) -> None:
        """Keeps the rows that are due; the first one is number `first`."""
        begin = 0
        for k in range(len(rows)):
            if first + k in self._due:
                row = self._peaks.fold(rows[begin : k + 1])
                self._kept.data[self._kept_count, 1 : 1 + len(row)] = row
                self._kept_count, begin = self._kept_count + 1, k + 1
        self._left = len(rows) - begin
        rows[: self._left] = rows[begin:].copy()

    @property
    def recording(self) -> Recording:
        """The rows kept so far."""
        return self._kept.rows(slice(self._kept_count))

    @property
    def judged(self) -> Recording:
        """All rows so far, with the `judged` columns at least."""
        return self._judged.rows(slice(self._count))


def _table(names: Sequence[str], times: Array, commands: Array) -> Recording:
    """Returns rows whose columns adjoin in memory, because metrics read columns."""
    data = np.empty((len(times), 1 + len(names) + len(COMMAND_COLUMNS)), order="F")
    data[:, 0], data[:, 1 + len(names) :] = times, commands
    return Recording(("time", *names, *COMMAND_COLUMNS), data)


class Recorder(Rows):
    """Records the present values of a plant's signals, one row per macro-step.

    `extra`: further arrays to record, by the names of their entries in memory order; each row reads
    them again. Other arguments are those of Rows.
    """

    def __init__(
        self,
        signals: Signals,
        times: Array,
        commands: Array,
        *,
        extra: Mapping[tuple[str, ...], NDArray[Any]] = MappingProxyType({}),
        every: int = 1,
        judged: Sequence[str] = (),
    ) -> None:
        self._sources = [signals.values, *(array.reshape(-1) for array in extra.values())]
        names = (*signals.names, *(name for names in extra for name in names))
        super().__init__(names, times, commands, every=every, judged=judged)
        self.names = ("time", *names, *COMMAND_COLUMNS)
        self._waiting = 0

    def record(self) -> None:
        """Adds a row with the present values."""
        np.concatenate(self._sources, out=self.room[self._waiting])
        self._waiting += 1
        if self._waiting == BLOCK_ROWS:
            self.finish()

    def finish(self) -> None:
        """Stores the rows that are recorded."""
        self.store(self._waiting)
        self._waiting = 0


def kept_moments(rows: int, every: int) -> NDArray[np.intp]:
    """Returns the indices of the kept rows: the first, every `every`-th after it, and the last."""
    moments = np.arange(0, rows, every)
    return moments if moments[-1] == rows - 1 else np.append(moments, rows - 1)


class Peaks:
    """Folds the peaks of all rows since the last kept one into the row to keep.

    The plant restarts `landing_rate` at a touch-down; its largest value restarts at the first
    touch-down since the last kept row.
    """

    def __init__(self, names: Sequence[str]) -> None:
        place = {name: k for k, name in enumerate(names)}
        self._plain = [place[name] for key in PEAKS for name in foot_names(key) if name in place]
        rates = [name for name in foot_names(LANDING_RATE) if name in place]
        self._rates = [place[name] for name in rates]
        self._counts = [place[name.removesuffix(LANDING_RATE) + LANDINGS] for name in rates]
        self._landings = np.zeros(len(rates))  # in the last kept row

    def fold(self, rows: Array) -> Array:
        """Returns the last one of some rows (rows, names) with the peaks of all of them."""
        row: Array = rows[-1].copy()
        counts = rows[:, self._counts]
        landed = np.logical_or.accumulate(counts != self._landings)
        since = landed | ~landed[-1]  # all rows where no foot has landed
        row[self._plain] = np.maximum(rows[:, self._plain].max(axis=0), 0.0)
        row[self._rates] = np.where(since, rows[:, self._rates], 0.0).max(axis=0)
        self._landings = counts[-1]
        return row
