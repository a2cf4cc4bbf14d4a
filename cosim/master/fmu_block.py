"""Variables of an FMU, alone and in blocks that one call reads or writes, and its log messages.

fmpy's message formatter accepts one Python callback per process, so all instances share one.
"""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from numbers import Real
from typing import Any

import numpy as np
from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy
from numpy.typing import NDArray

from hexapod_cosim.models.errors import FmuError, unknown_name

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING = STATUS.index("warning")
MAX_MESSAGES = 20

_logs: dict[int, deque[str]] = {}  # by componentEnvironment, which the FMU returns with a message
_environments = count(1)
SUFFIX = {  # of fmi2Get... and fmi2Set... for each FMI type
    "Real": "Real",
    "Integer": "Integer",
    "Enumeration": "Integer",
    "Boolean": "Boolean",
}


class StepError(FmuError):
    """The FMU discarded or refused a step.

    `reached` is the last time [s] for which the FMU's state is valid; NaN when it does not say.
    """

    def __init__(self, what: str, *, reached: float, **facts: Any) -> None:
        super().__init__(what, **facts)
        self.reached = reached


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU."""

    name: str
    causality: str
    real: bool  # whether it is a floating-point variable
    flag: bool  # whether it is a Boolean variable
    size: int  # number of elements; 1 for a scalar


class FmuBlock:
    """Variables of one type that are read or written in one call.

    The arguments of the C calls are converted once, here, so that a call allocates nothing.

    `bind` returns the call of a C function with fixed arguments. `buffer`: a contiguous array for
    the values, float64 for Reals and int32 for all other types; without one, the block allocates
    its own.
    """

    def __init__(
        self,
        bind: Callable[..., Callable[[], int]],
        log: FmuLog,
        names: Sequence[str],
        kind: str,
        references: Sequence[int],
        buffer: NDArray[Any] | None,
    ) -> None:
        dtype = np.dtype(np.float64 if kind == "Real" else np.int32)
        values = np.zeros(len(names), dtype) if buffer is None else buffer
        assert (values.dtype, values.shape) == (dtype, (len(names),)), "not a buffer of these"
        assert values.flags.c_contiguous, "not a contiguous buffer"
        self.names, self.values = tuple(names), values
        self._log = log
        numbers = (ctypes.c_uint * len(names))(*references)
        size, address = ctypes.c_size_t(len(names)), ctypes.c_void_p(values.ctypes.data)
        self._get = bind(f"fmi2Get{SUFFIX[kind]}", numbers, size, address)
        self._set = bind(f"fmi2Set{SUFFIX[kind]}", numbers, size, address)

    def get(self) -> None:
        """Reads all values from the FMU. Raises FmuError."""
        self._call(self._get, "the FMU does not give its outputs")

    def try_set(self) -> int:
        """Writes all values to the FMU and returns the FMI status."""
        self._log.clear()
        return self._set()

    def set(self) -> None:
        """Writes all values to the FMU. Raises FmuError."""
        self._call(self._set, "the FMU does not take its inputs")

    def _call(self, call: Callable[[], int], what: str) -> None:
        self._log.clear()
        status = call()
        if status > WARNING:
            raise self._log.failure(what, status)


def parameter_number(variable: Any, value: Any) -> float:
    """Returns the number that an FMU takes for a value of a parameter, a variable of fmpy.

    Raises FmuError for a value of another kind.
    """
    if isinstance(value, str) and variable.type == "Enumeration":
        items = {item.name: item.value for item in variable.declaredType.items}
        if value not in items:
            raise unknown_name(f"choice for {variable.name}", value, items, error=FmuError)
        return int(items[value])
    flag = isinstance(value, bool) and variable.type == "Real"
    if flag or not isinstance(value, Real):  # NumPy's numbers as well
        raise FmuError(
            f"parameter {variable.name} is refused",
            got=value,
            expected=f"a number [{variable.unit or '1'}]",
            fix="give a number",
        )
    return float(value)


def type_of_block(
    variables: Mapping[str, Any], names: Iterable[str], empty: str, *, where: str
) -> str:
    """Returns the one type of the named variables; `empty` without names. Raises FmuError."""
    kinds = {variables[name].type for name in names} or {empty}
    if len(kinds) != 1:
        what, fix = "connected variables of several types", "give them one type"
        raise FmuError(what, got=sorted(kinds), fix=fix, where=where)
    return str(kinds.pop())


class FmuLog:
    """Warnings and errors of one instance, the newest last.

    `file` is the FMU's, for errors; `callbacks` the structure to instantiate the FMU with. Every
    call of the FMU clears the log first, so that errors quote new messages only.
    """

    def __init__(self, file: str) -> None:
        self.file, self.messages = file, deque[str](maxlen=MAX_MESSAGES)
        self.clear = self.messages.clear
        self._environment = next(_environments)
        _logs[self._environment] = self.messages
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = _logger
        self.callbacks.allocateMemory = defaultCallbacks.allocateMemory
        self.callbacks.freeMemory = defaultCallbacks.freeMemory
        self.callbacks.componentEnvironment = self._environment
        addLoggerProxy(ctypes.byref(self.callbacks))  # formats the variadic message in C

    def last(self, otherwise: str) -> str:
        """Returns the last message, or other text where there is none."""
        return self.messages[-1] if self.messages else otherwise

    def last_of(self, status: int) -> str:
        """Returns the last message for a call that returned `status`."""
        return self.last(f"status {STATUS[status]} without a message")

    def failure(self, what: str, status: int) -> FmuError:
        """Returns the error for a call that returned `status`, with the last message."""
        return FmuError(what, got=self.last_of(status), where=self.file)

    def close(self) -> None:
        """Stops collecting messages; may be called twice."""
        _logs.pop(self._environment, None)


def _write(
    environment: int | None, _name: bytes, status: int, _category: bytes, message: bytes
) -> None:
    log = _logs.get(environment or 0)
    if status >= WARNING and log is not None:
        log.append(message.decode("utf-8", errors="replace"))


_logger = fmi2CallbackLoggerTYPE(_write)  # never freed: the formatter keeps its address
