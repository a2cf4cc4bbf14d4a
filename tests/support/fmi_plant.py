"""Calls the FMU's FMI 2.0 functions through ctypes and records statuses and messages."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType

from hexapod_cosim.cosim.interface.model_description import render_fmi2
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.interface.records import Interface
from hexapod_cosim.models.robot import load_robot

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3
MODEL_EXCHANGE, CO_SIMULATION = 0, 1
DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED = 0, 1, 2, 3

ATHENA: Interface = load_interface(load_robot("athena"))
GUID = render_fmi2(ATHENA).guid

_LOGGER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)


class Callbacks(ctypes.Structure):
    """The structure fmi2CallbackFunctions; the memory functions stay NULL."""

    _fields_ = (
        ("logger", _LOGGER),
        ("allocate", ctypes.c_void_p),
        ("free", ctypes.c_void_p),
        ("step_finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    )


class Plant:
    """An instance of the FMU; `component` is None when instantiation was refused."""

    def __init__(
        self,
        library: Path,
        *,
        guid: str | None = GUID,
        resources: str | None = None,
        name: str | None = "plant",
        kind: int = CO_SIMULATION,
        logging: bool = False,
        callbacks: bool = True,
    ) -> None:
        self.messages: list[tuple[int, str, str]] = []
        self.speakers: set[str] = set()  # instance names that came with messages
        self._functions = Callbacks(logger=_LOGGER(self._log))
        self._library = ctypes.CDLL(str(library))
        self._library.fmi2Instantiate.restype = ctypes.c_void_p
        given = ctypes.byref(self._functions) if callbacks else None
        self.component = self._library.fmi2Instantiate(
            _bytes(name), kind, _bytes(guid), _bytes(resources), given, 0, int(logging)
        )

    def __enter__(self) -> Plant:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._library.fmi2FreeInstance(ctypes.c_void_p(self.component))

    def _log(
        self, _environment: int, name: bytes, status: int, category: bytes, text: bytes
    ) -> None:
        self.speakers.add(name.decode())
        self.messages.append((status, category.decode(), text.decode()))

    @property
    def last_message(self) -> str:
        """Returns the text of the last message."""
        return self.messages[-1][2]

    def call(self, function: str, *arguments: object) -> int:
        """Calls a function of the instance and returns its status.

        Floats are passed as double, ints as int.
        """
        converted = [
            ctypes.c_double(value) if isinstance(value, float) else value for value in arguments
        ]
        return int(getattr(self._library, function)(ctypes.c_void_p(self.component), *converted))

    def initialize(self, *, start: float = 0.0) -> Plant:
        """Enters step mode with default values."""
        assert self.call("fmi2SetupExperiment", 0, 0.0, start, 0, 0.0) == OK
        assert self.call("fmi2EnterInitializationMode") == OK
        assert self.call("fmi2ExitInitializationMode") == OK
        return self

    def step(self, time: float, size: float) -> int:
        """Calls fmi2DoStep."""
        return self.call("fmi2DoStep", float(time), float(size), 1)

    def set_reals(self, values: dict[str, float]) -> int:
        """Sets Reals by name in one call."""
        return self.set_references("fmi2SetReal", ATHENA.references(values), list(values.values()))

    def set_references(
        self, function: str, references: Sequence[int], values: Sequence[float]
    ) -> int:
        """Calls a setter with references."""
        n = len(references)
        array = (
            (ctypes.c_double * n)(*values)
            if function == "fmi2SetReal"
            else (ctypes.c_int * n)(*map(int, values))
        )
        return self.call(function, (ctypes.c_uint * n)(*references), ctypes.c_size_t(n), array)

    def get_references(self, function: str, references: Sequence[int]) -> tuple[int, list[float]]:
        """Calls a getter with references; returns status and values."""
        n = len(references)
        values = ((ctypes.c_double if function == "fmi2GetReal" else ctypes.c_int) * n)()
        status = self.call(function, (ctypes.c_uint * n)(*references), ctypes.c_size_t(n), values)
        return status, list(values)

    def reals(self, names: Iterable[str]) -> list[float]:
        """Returns Reals by name."""
        status, values = self.get_references("fmi2GetReal", ATHENA.references(names))
        assert status == OK, self.last_message
        return values

    def real(self, name: str) -> float:
        """Returns a Real by name."""
        return self.reals([name])[0]

    def everything(self) -> list[float]:
        """Returns all Real variables."""
        return self.reals(
            [variable.name for variable in ATHENA.variables if variable.type == "Real"]
        )

    def save(self) -> ctypes.c_void_p:
        """Calls fmi2GetFMUstate."""
        state = ctypes.c_void_p()
        assert self.call("fmi2GetFMUstate", ctypes.byref(state)) == OK
        return state

    def serialize(self, state: ctypes.c_void_p) -> bytes:
        """Returns the bytes of a saved state."""
        size = ctypes.c_size_t()
        assert self.call("fmi2SerializedFMUstateSize", state, ctypes.byref(size)) == OK
        data = ctypes.create_string_buffer(size.value)
        assert self.call("fmi2SerializeFMUstate", state, data, size) == OK
        return data.raw

    def deserialize(self, data: bytes) -> tuple[int, ctypes.c_void_p]:
        """Returns status and state."""
        state = ctypes.c_void_p()
        return self.call(
            "fmi2DeSerializeFMUstate", data, ctypes.c_size_t(len(data)), ctypes.byref(state)
        ), state

    def free(self, state: ctypes.c_void_p) -> None:
        """Calls fmi2FreeFMUstate."""
        assert self.call("fmi2FreeFMUstate", ctypes.byref(state)) == OK
        assert state.value is None


def _bytes(text: str | None) -> bytes | None:
    return None if text is None else text.encode()
