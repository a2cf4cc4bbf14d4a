"""What a run leaves: rows of macro-steps in columns made beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
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
PEAKS = ("peak_force", "peak_force_rate")  # of a foot within the last communication step
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
    """A variable that was not recorded."""


@dataclass(frozen=True)
class Recording:
    """Rows of a run. Row k: outputs read at time[k], and the inputs set then, which hold until
    time[k + 1].
    """

    names: tuple[str, ...]  # the first is "time" [s]
    data: Array  # (rows, names)
    _index: dict[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_index", {name: k for k, name in enumerate(self.names)})

    @property
    def time(self) -> Array:
        """(rows,) [s]"""
        return self.data[:, 0]

    def column(self, name: str) -> Array:
        """(rows,) one variable. Raises HexapodError when it was not recorded."""
        return self.columns([name])[:, 0]

    def columns(self, names: Sequence[str]) -> Array:
        """(rows, names) several variables. Raises HexapodError when one was not recorded."""
        for name in names:
            if name not in self._index:
                near = nearest_name(name, self.names)
                fix = (
                    f"did you mean {near!r}?"
                    if near
                    else "record it: outputs.csv names the columns that are kept"
                )
                raise ColumnError("no such column in the recording", got=name, fix=fix)
        return self.data[:, [self._index[name] for name in names]]

    def joints(self, quantity: str) -> Array:
        """(rows, 6, 3) a quantity of all joints."""
        return self.columns(joint_names(quantity)).reshape(-1, LEGS, JOINTS)

    def feet(self, quantity: str) -> Array:
        """(rows, 6) a scalar quantity of all feet."""
        return self.columns(foot_names(quantity))

    def foot_vectors(self, quantity: str) -> Array:
        """(rows, 6, 3) a vector quantity of all feet, world axes."""
        return self.columns(foot_vector_names(quantity)).reshape(-1, LEGS, 3)

    def vector(self, stem: str, size: int = 3) -> Array:
        """(rows, size) a vector variable."""
        return self.columns(vector_names(stem, size))

    def rows(self, chosen: slice) -> Recording:
        """The same columns of fewer rows, not copied."""
        return Recording(self.names, self.data[chosen])

    def chosen(self, patterns: Sequence[str]) -> Recording:
        """Time and the columns that match a pattern (`*` any text). Raises ScenarioError when a
        pattern matches nothing.
        """
        keep = chosen_columns(self.names, patterns)
        if len(keep) == len(self.names):
            return self
        return Recording(tuple(self.names[k] for k in keep), self.data[:, keep])


def chosen_columns(
    names: Sequence[str], patterns: Sequence[str], *, where: str = "outputs.csv"
) -> list[int]:
    """Places of time and of the names that match a pattern (`*` any text). Raises ScenarioError
    when a pattern matches nothing.
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
    """Fills rows of a run; times (rows,) and body commands (rows, 6) are known beforehand, so a row
    copies the plant's values and no more.

    `extra` holds further things to record: an array, seen afresh at every row, under the names of
    its entries in memory order. With `every` > 1 only one of so many rows is kept, the last one
    always; then `judged` names what all rows are kept of, and in the rows kept the plant's peaks
    are the largest since the row before.
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
        self._thinned = None if every == 1 else Thinned(self.names, judged, len(times), every)
        rows = len(times) if every == 1 else 1  # of which one is filled again and again
        self._data = np.full(
            (rows, len(self.names)), np.nan
        )  # filled, so that no row is the first to touch its memory
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
        """Adds a row: everything as it stands."""
        k = self._count
        row = k if self._thinned is None else 0
        for target, source in self._copies:
            target[row] = source
        if self._thinned is not None:
            self._times[0], self._commands[0] = self._known[0][k], self._known[1][k]
            self._thinned.add(self._data[0])
        self._count = k + 1  # last: an interrupt before it loses the row, not its integrity

    @property
    def recording(self) -> Recording:
        """The rows so far that are kept."""
        if self._thinned is not None:
            return Recording(self.names, self._thinned.rows)
        return Recording(self.names, self._data[: self._count])

    @property
    def judged(self) -> Recording:
        """Every row so far, of what is judged at least."""
        if self._thinned is not None:
            return Recording(self._thinned.names, self._thinned.judged[: self._count])
        return self.recording


class Thinned:
    """Rows of which one of `every` is kept, and the last; of all of them what is judged. For
    `rows` rows at most.
    """

    def __init__(self, names: Sequence[str], judged: Sequence[str], rows: int, every: int) -> None:
        wanted = {"time", *judged, *COMMAND_COLUMNS}
        self._places = [k for k, name in enumerate(names) if name in wanted]
        self.names = tuple(names[k] for k in self._places)
        self.judged: Array = np.full((rows, len(self._places)), np.nan)
        moments = kept_moments(rows, every)
        self._kept = np.full((len(moments), len(names)), np.nan)
        self._due, self._count, self._full = set(moments.tolist()), 0, 0
        self._peaks = Peaks(names)

    def add(self, row: Array) -> None:
        """The next row (names,)."""
        k = self._count
        self.judged[k] = row[self._places]
        self._peaks.see(row)
        if k in self._due:
            self._kept[self._full] = row
            self._peaks.show(self._kept[self._full])
            self._full += 1
        self._count = k + 1

    @property
    def rows(self) -> Array:
        """(rows, names) those kept so far."""
        return self._kept[: self._full]


def kept_moments(rows: int, every: int) -> NDArray[np.intp]:
    """Which of so many rows are kept: the first, every `every`-th after it, and the last."""
    return np.unique(np.append(np.arange(0, rows, every), rows - 1))


class Peaks:
    """Columns of peaks, folded: the largest value since the row that was kept last.

    A landing's rate begins anew at a touch-down; so does its largest, at the first touch-down since
    then.
    """

    def __init__(self, names: Sequence[str]) -> None:
        place = {name: k for k, name in enumerate(names)}
        plain = [name for quantity in PEAKS for name in foot_names(quantity) if name in place]
        restarted = [name for name in foot_names(LANDING_RATE) if name in place]
        counts = [name.removesuffix(LANDING_RATE) + LANDINGS for name in restarted]
        self.places = [place[name] for name in (*plain, *restarted)]
        self.counts = [place[name] for name in counts]  # of the last ones of these places
        self._fresh = np.zeros(len(self.places), dtype=np.bool_)
        self._largest, self._seen, self._kept = (
            np.zeros(len(self.places)),
            np.zeros(len(counts)),
            np.zeros(len(counts)),
        )

    def see(self, row: Array) -> None:
        """Takes a row's peaks in."""
        counts = row[self.counts]
        self._fresh[len(self.places) - len(counts) :] = (counts != self._seen) & (
            self._seen == self._kept
        )
        values = row[self.places]
        self._largest = np.where(self._fresh, values, np.maximum(self._largest, values))
        self._seen = counts

    def show(self, row: Array) -> None:
        """Puts them into the row that is kept, and begins anew."""
        row[self.places] = self._largest
        self._largest, self._kept = np.zeros(len(self.places)), self._seen
