"""Calls the FMU's FMI 3.0 functions through ctypes and records statuses and messages."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from fmi_plant import ATHENA, GUID, OK
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.arrays import Array, arrays

ARRAYS: dict[str, Array] = {array.name: array for array in arrays(ATHENA)}
TIME = ATHENA.first_reference["independent"]
TYPES: dict[str, tuple[str, Any]] = {
    "Real": ("Float64", ctypes.c_double),
    "Enumeration": ("Int64", ctypes.c_int64),
    "Boolean": ("Boolean", ctypes.c_bool),
}
STATE_NAMES = [state.name for state in ATHENA.states]

_LOGGER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class Step(NamedTuple):
    """The results of fmi3DoStep."""

    status: int
    event: bool
    terminate: bool
    early: bool
    time: float  # s


UPDATE = ctypes.CFUNCTYPE(
    None,
    ctypes.c_void_p,
    ctypes.c_double,
    *[ctypes.c_bool] * 4,
    ctypes.POINTER(ctypes.c_bool),
    ctypes.POINTER(ctypes.c_double),
)


class Plant3:
    """An instance of the FMU; `handle` is None when instantiation was refused."""

    def __init__(
        self,
        library: Path,
        *,
        kind: str = "CoSimulation",
        token: str | None = GUID,
        resources: str | None = None,
        name: str | None = "plant",
        events: bool = False,
        early: bool = False,
        logger: bool = True,
        logging: bool = False,
        intermediate: Callable[[float], float | None] | None = None,
    ) -> None:
        """intermediate: is called with the time of an intermediate update, and returns a time at
        which to return early.
        """
        self.messages: list[tuple[int, str, str]] = []
        self._logger = _LOGGER(self._log) if logger else _LOGGER()
        self._library = ctypes.CDLL(str(library))
        texts = [None if text is None else text.encode() for text in (name, token, resources)]
        flags = [ctypes.c_bool(value) for value in (False, logging)]
        between = {
            "CoSimulation": [ctypes.c_bool(events), ctypes.c_bool(early), None, ctypes.c_size_t(0)]
        }.get(kind, [])
        self._intermediate = intermediate
        self._update = UPDATE(self._on_update) if intermediate else None
        callbacks: dict[str, list[Any]] = {
            "CoSimulation": [self._update],
            "ScheduledExecution": [None, None, None],
        }
        after = callbacks.get(kind, [])
        instantiate = getattr(self._library, f"fmi3Instantiate{kind}")
        instantiate.restype = ctypes.c_void_p
        self.handle = instantiate(*texts, *flags, *between, None, self._logger, *after)

    def __enter__(self) -> Plant3:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._library.fmi3FreeInstance(ctypes.c_void_p(self.handle))

    def _on_update(
        self, _environment: int, time: float, settable: bool, readable: bool, finished: bool,
        can_return: bool, requested: Any, early: Any,
    ) -> None:  # fmt: skip
        assert settable
        assert readable
        assert finished
        assert self._intermediate is not None
        wanted = self._intermediate(time)
        if wanted is not None:
            assert can_return
            requested[0], early[0] = True, wanted

    def _log(self, _environment: int, status: int, category: bytes, text: bytes) -> None:
        self.messages.append((status, category.decode(), text.decode()))

    @property
    def last_message(self) -> str:
        """Returns the text of the last message."""
        return self.messages[-1][2]

    def call(self, function: str, *arguments: object) -> int:
        """Calls a function of the instance and returns its status.

        Floats are passed as double, bools as bool, ints as size_t.
        """
        converted = [_argument(value) for value in arguments]
        return int(getattr(self._library, function)(ctypes.c_void_p(self.handle), *converted))

    def initialize(self, *, start: float = 0.0) -> Plant3:
        """Enters step mode, or event mode where it is used, with default values."""
        assert self.enter_initialization(start) == OK
        assert self.call("fmi3ExitInitializationMode") == OK
        return self

    def enter_initialization(
        self, start: float = 0.0, stop: float | None = None, tolerance: float | None = None
    ) -> int:
        """Calls fmi3EnterInitializationMode."""
        given = [tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0]
        return self.call("fmi3EnterInitializationMode", *given)

    def step(self, time: float, size: float) -> Step:
        """Calls fmi3DoStep."""
        flags, reached = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()
        status = self.call(
            "fmi3DoStep",
            float(time),
            float(size),
            True,
            *map(ctypes.byref, flags),
            ctypes.byref(reached),
        )
        event, terminate, early = (flag.value for flag in flags)
        return Step(status, event, terminate, early, reached.value)

    def update(self) -> tuple[int, list[bool]]:
        """Calls fmi3UpdateDiscreteStates; returns the status and the flags."""
        flags, time = [ctypes.c_bool(True) for _ in range(5)], ctypes.c_double()
        status = self.call(
            "fmi3UpdateDiscreteStates", *map(ctypes.byref, flags), ctypes.byref(time)
        )
        return status, [flag.value for flag in flags]

    def get_raw(self, kind: str, references: Sequence[int], count: int) -> tuple[int, list[Any]]:
        """Calls a getter with references; returns status and values."""
        ctype = next(ctype for name, ctype in TYPES.values() if name == kind)
        values = (ctype * count)()
        return self.call(
            f"fmi3Get{kind}", _uints(references), len(references), values, count
        ), list(values)

    def set_raw(self, kind: str, references: Sequence[int], values: Sequence[Any]) -> int:
        """Calls a setter with references."""
        ctype = next(ctype for name, ctype in TYPES.values() if name == kind)
        return self.call(
            f"fmi3Set{kind}",
            _uints(references),
            len(references),
            (ctype * len(values))(*values),
            len(values),
        )

    def get(self, *names: str) -> list[NDArray[Any]]:
        """Returns the values of variables of one type, as arrays."""
        chosen = [ARRAYS[name] for name in names]
        status, values = self.get_raw(
            TYPES[chosen[0].first.type][0], [array.reference for array in chosen], _size(chosen)
        )
        assert status == OK, self.last_message
        ends = np.cumsum([len(array.elements) for array in chosen])[:-1]
        return [
            part.reshape(array.shape)
            for part, array in zip(np.split(np.array(values), ends), chosen, strict=True)
        ]

    def set(self, values: Mapping[str, Any]) -> int:
        """Sets variables of one type, in one call."""
        chosen = [ARRAYS[name] for name in values]
        flat = [element for value in values.values() for element in np.ravel(value).tolist()]
        return self.set_raw(
            TYPES[chosen[0].first.type][0], [array.reference for array in chosen], flat
        )

    def everything(self) -> NDArray[np.float64]:
        """Returns all Float64 variables."""
        names = [name for name, array in ARRAYS.items() if array.first.type == "Real"]
        return np.concatenate([part.ravel() for part in self.get(*names)])

    def row(self, function: str, n: int) -> NDArray[np.float64]:
        """Calls a function of model exchange that returns n doubles."""
        place = (ctypes.c_double * n)()
        assert self.call(function, place, n) == OK, self.last_message
        return np.array(place)

    def save(self) -> ctypes.c_void_p:
        """Calls fmi3GetFMUState."""
        state = ctypes.c_void_p()
        assert self.call("fmi3GetFMUState", ctypes.byref(state)) == OK
        return state

    def serialize(self, state: ctypes.c_void_p) -> bytes:
        """Returns the bytes of a saved state."""
        size = ctypes.c_size_t()
        assert self.call("fmi3SerializedFMUStateSize", state, ctypes.byref(size)) == OK
        data = ctypes.create_string_buffer(size.value)
        assert self.call("fmi3SerializeFMUState", state, data, size) == OK
        return data.raw

    def deserialize(self, data: bytes) -> tuple[int, ctypes.c_void_p]:
        """Returns status and state."""
        state = ctypes.c_void_p()
        return self.call("fmi3DeserializeFMUState", data, len(data), ctypes.byref(state)), state

    def free(self, state: ctypes.c_void_p) -> None:
        """Calls fmi3FreeFMUState."""
        assert self.call("fmi3FreeFMUState", ctypes.byref(state)) == OK
        assert state.value is None


def _argument(value: object) -> object:
    if isinstance(value, bool):
        return ctypes.c_bool(value)
    if isinstance(value, int):
        return ctypes.c_size_t(value)
    return ctypes.c_double(value) if isinstance(value, float) else value


def _uints(references: Sequence[int]) -> ctypes.Array[ctypes.c_uint]:
    return (ctypes.c_uint * len(references))(*references)


def _size(chosen: Sequence[Array]) -> int:
    return sum(len(array.elements) for array in chosen)
