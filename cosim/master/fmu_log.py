"""What FMUs say, each to its own log: fmpy's formatter of messages knows one Python function in
a process, so all instances share ours.
"""

from __future__ import annotations

import ctypes
from collections import deque
from itertools import count

from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING = STATUS.index("warning")
KEPT = 20  # messages

_logs: dict[
    int, deque[str]
] = {}  # by the environment that an instance hands back with its messages
_environments = count(1)


class FmuLog:
    """Warnings and errors of one instance, the newest last; `callbacks` are what it is made
    with.
    """

    def __init__(self) -> None:
        self.messages: deque[str] = deque(maxlen=KEPT)
        self._environment = next(_environments)
        _logs[self._environment] = self.messages
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = _logger
        self.callbacks.allocateMemory = defaultCallbacks.allocateMemory
        self.callbacks.freeMemory = defaultCallbacks.freeMemory
        self.callbacks.componentEnvironment = self._environment
        addLoggerProxy(ctypes.byref(self.callbacks))  # formats the variadic message in C

    def close(self) -> None:
        """Nothing is kept from here on; harmless when called twice."""
        _logs.pop(self._environment, None)


def _write(
    environment: int | None, _name: bytes, status: int, _category: bytes, message: bytes
) -> None:
    log = _logs.get(environment or 0)
    if status >= WARNING and log is not None:
        log.append(message.decode("utf-8", errors="replace"))


_logger = fmi2CallbackLoggerTYPE(
    _write
)  # lives as long as the process: the formatter keeps its address
