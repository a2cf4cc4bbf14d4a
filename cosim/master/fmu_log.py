"""Collects the log messages of FMU instances, one log for each instance.

fmpy's message formatter accepts one Python callback per process, so all instances share one.
"""

from __future__ import annotations

import ctypes
from collections import deque
from itertools import count

from fmpy.fmi2 import defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING = STATUS.index("warning")
MAX_MESSAGES = 20

_logs: dict[int, deque[str]] = {}  # by componentEnvironment, which the FMU returns with a message
_environments = count(1)


class FmuLog:
    """Warnings and errors of one instance, the newest last.

    `callbacks` is the structure to instantiate the FMU with.
    """

    def __init__(self) -> None:
        self.messages: deque[str] = deque(maxlen=MAX_MESSAGES)
        self._environment = next(_environments)
        _logs[self._environment] = self.messages
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = _logger
        self.callbacks.allocateMemory = defaultCallbacks.allocateMemory
        self.callbacks.freeMemory = defaultCallbacks.freeMemory
        self.callbacks.componentEnvironment = self._environment
        addLoggerProxy(ctypes.byref(self.callbacks))  # formats the variadic message in C

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
