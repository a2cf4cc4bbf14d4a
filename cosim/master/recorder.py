"""Records the rows of a run, one per macro-step or fewer, into arrays allocated beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import lru_cache
from itertools import pairwise
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
from hexapod_cosim.models import HexapodError, ScenarioError, nearest_name

Array = NDArray[np.float64]
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
            if name not in self._index:
                near = nearest_name(name, self.names)
                fix = "record it: outputs.csv names the columns that are kept"
                if near:
                    fix = f"did you mean {near!r}?"
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
            near = nearest_name(pattern, names)
            fix = f"did you mean {near!r}?" if near else "`fmpy info` lists the names"
            raise ScenarioError("no output has this name", got=pattern, fix=fix, where=where)
    return [
        k
        for k, name in enumerate(names)
        if k == 0 or any(_matches(name, pattern) for pattern in patterns)
    ]


def _matches(name: str, pattern: str) -> bool:
    return fnmatchcase(name, pattern.replace("[", "[[]"))  # brackets in our names mean an index


class Recorder:
    """Records one row per macro-step; times (rows,) and body commands (rows, 6) are known before.

    `extra`: further arrays to record, by the names of their entries in memory order; each row reads
    them again. With `every` > 1 only the first, every `every`-th and the last row are kept; then
    `judged` names the columns that are kept of all rows, and the plant's peaks in a kept row are
    the largest since the kept row before.
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
        sources = {signals.names: signals.values} | {
            names: array.reshape(-1) for names, array in extra.items()
        }
        self.names = ("time", *(name for names in sources for name in names), *COMMAND_COLUMNS)
        ends = np.cumsum([1, *map(len, sources)]).tolist()
        self._thinned = None if every == 1 else ThinnedRows(self.names, judged, len(times), every)
        rows = len(times) if every == 1 else 1  # thinned: one row is filled again and again
        # filling touches all memory now rather than during the run
        self._data = np.full((rows, len(self.names)), np.nan)
        self._times, self._commands = self._data[:, 0], self._data[:, ends[-1] :]
        self._known = times, commands
        if every == 1:
            self._times[:], self._commands[:] = times, commands
        self._copies = [
            (self._data[:, begin:end], source)
            for (begin, end), source in zip(pairwise(ends), sources.values(), strict=True)
        ]
        self._count = 0

    def record(self) -> None:
        """Adds a row with the present values."""
        k = self._count
        row = k if self._thinned is None else 0
        for target, source in self._copies:
            target[row] = source
        if self._thinned is not None:
            self._times[0], self._commands[0] = self._known[0][k], self._known[1][k]
            self._thinned.add(self._data[0])
        self._count = k + 1  # last, so that an interrupted row is not counted

    @property
    def recording(self) -> Recording:
        """The rows kept so far."""
        if self._thinned is not None:
            return Recording(self.names, self._thinned.rows)
        return Recording(self.names, self._data[: self._count])

    @property
    def judged(self) -> Recording:
        """All rows so far, with the `judged` columns at least."""
        if self._thinned is not None:
            return Recording(self._thinned.names, self._thinned.judged[: self._count])
        return self.recording


class ThinnedRows:
    """Keeps one of `every` rows and the last one; of all rows it keeps the `judged` columns.

    `rows` is the largest number of rows.
    """

    def __init__(self, names: Sequence[str], judged: Sequence[str], rows: int, every: int) -> None:
        wanted = {"time", *judged, *COMMAND_COLUMNS}
        self._places = [k for k, name in enumerate(names) if name in wanted]
        self.names = tuple(names[k] for k in self._places)
        self.judged: Array = np.full((rows, len(self._places)), np.nan)
        moments = kept_moments(rows, every)
        self._kept = np.full((len(moments), len(names)), np.nan)
        self._due = set(moments.tolist())
        self._count = self._kept_count = 0
        self._peaks = Peaks(names)

    def add(self, row: Array) -> None:
        """Adds a row (names,)."""
        k = self._count
        self.judged[k] = row[self._places]
        self._peaks.update(row)
        if k in self._due:
            self._kept[self._kept_count] = row
            self._peaks.write(self._kept[self._kept_count])
            self._kept_count += 1
        self._count = k + 1

    @property
    def rows(self) -> Array:
        """The kept rows so far (rows, names)."""
        return self._kept[: self._kept_count]


def kept_moments(rows: int, every: int) -> NDArray[np.intp]:
    """Returns the indices of the kept rows: the first, every `every`-th after it, and the last."""
    moments = np.arange(0, rows, every)
    return moments if moments[-1] == rows - 1 else np.append(moments, rows - 1)


class Peaks:
    """Tracks the largest value of each peak column since the last kept row.

    The plant restarts `landing_rate` at a touch-down; its largest value restarts at the first
    touch-down since the last kept row.
    """

    def __init__(self, names: Sequence[str]) -> None:
        place = {name: k for k, name in enumerate(names)}
        plain = [name for quantity in PEAKS for name in foot_names(quantity) if name in place]
        restarted = [name for name in foot_names(LANDING_RATE) if name in place]
        counts = [name.removesuffix(LANDING_RATE) + LANDINGS for name in restarted]
        self.places = [place[name] for name in (*plain, *restarted)]
        self.counts = [place[name] for name in counts]  # for the last ones of `places`
        self._fresh = np.zeros(len(self.places), dtype=np.bool_)
        self._largest = np.zeros(len(self.places))
        self._seen, self._kept = np.zeros(len(counts)), np.zeros(len(counts))

    def update(self, row: Array) -> None:
        """Takes the peaks of a row into account."""
        counts = row[self.counts]
        landed = (counts != self._seen) & (self._seen == self._kept)
        self._fresh[len(self.places) - len(counts) :] = landed
        values = row[self.places]
        self._largest = np.where(self._fresh, values, np.maximum(self._largest, values))
        self._seen = counts

    def write(self, row: Array) -> None:
        """Writes the largest values into the row to keep and restarts."""
        row[self.places] = self._largest
        self._largest, self._kept = np.zeros(len(self.places)), self._seen
