"""What a run leaves: one row per macro-step in columns made beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.signals import JOINTS, LEGS, Signals, foot_names, foot_vector_names, joint_names, vector_names
from hexapod_cosim.models import HexapodError, ScenarioError, nearest_name

Array = NDArray[np.float64]
COMMAND_COLUMNS = ("command.vx", "command.vy", "command.yaw_rate", "command.height", "command.roll", "command.pitch")


class ColumnError(HexapodError):
    """A variable that was not recorded."""


@dataclass(frozen=True)
class Recording:
    """Rows of a run. Row k: outputs read at time[k], and the inputs set then, which hold until time[k + 1]."""

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
                fix = f"did you mean {near!r}?" if near else "record it: outputs.csv names the columns that are kept"
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
        """Time and the columns that match a pattern (`*` any text). Raises ScenarioError when a pattern matches nothing."""
        keep = chosen_columns(self.names, patterns)
        if len(keep) == len(self.names):
            return self
        return Recording(tuple(self.names[k] for k in keep), self.data[:, keep])


def chosen_columns(names: Sequence[str], patterns: Sequence[str], *, where: str = "outputs.csv") -> list[int]:
    """Places of time and of the names that match a pattern (`*` any text). Raises ScenarioError when a pattern matches nothing."""
    for pattern in patterns:
        if not any(_matches(name, pattern) for name in names):
            near = nearest_name(pattern, names)
            fix = f"did you mean {near!r}?" if near else "`fmpy info` lists the names"
            raise ScenarioError("no output has this name", got=pattern, fix=fix, where=where)
    return [k for k, name in enumerate(names) if k == 0 or any(_matches(name, pattern) for pattern in patterns)]


def _matches(name: str, pattern: str) -> bool:
    return fnmatchcase(name, pattern.replace("[", "[[]"))  # brackets in our names mean an index


class Recorder:
    """Fills rows of a run; times (rows,) and body commands (rows, 6) are known beforehand, so a row copies the plant's values and no more.

    `extra` holds further things to record: an array, seen afresh at every row, under the names of its entries in memory order.
    """

    def __init__(
        self, signals: Signals, times: Array, commands: Array, *, extra: Mapping[tuple[str, ...], NDArray[Any]] = MappingProxyType({})
    ) -> None:
        sources = {signals.names: signals.values} | {names: array.reshape(-1) for names, array in extra.items()}
        self.names = ("time", *(name for names in sources for name in names), *COMMAND_COLUMNS)
        ends = np.cumsum([1, *map(len, sources)]).tolist()
        self._data = np.full((len(times), len(self.names)), np.nan)  # filled, so that no row is the first to touch its memory
        self._data[:, 0], self._data[:, ends[-1] :] = times, commands
        self._copies = [(self._data[:, begin:end], source) for (begin, end), source in zip(pairwise(ends), sources.values(), strict=True)]
        self._count = 0

    def record(self) -> None:
        """Adds a row: everything as it stands."""
        k = self._count
        for target, source in self._copies:
            target[k] = source
        self._count = k + 1  # last: an interrupt before it loses the row, not its integrity

    @property
    def recording(self) -> Recording:
        """The rows so far."""
        return Recording(self.names, self._data[: self._count])
