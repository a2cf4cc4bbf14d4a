"""Controls where Ctrl-C and SIGTERM may interrupt: not while a recording is being written."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class _DeferredSignal:
    """A signal handler that only records that a signal arrived."""

    pending = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self.pending = True


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """Defers interrupts until the block has ended, and then raises KeyboardInterrupt.

    Has no effect outside Python's main thread, which alone receives signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    deferred = _DeferredSignal()
    before = {number: signal.signal(number, deferred) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if deferred.pending:
        raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[None]:
    """Allows interrupts again within `deferred_interrupts`.

    Raises KeyboardInterrupt for an interrupt in the block and for one deferred before it.
    """
    deferred = signal.getsignal(signal.SIGINT)
    if not isinstance(deferred, _DeferredSignal):
        yield
        return
    try:
        for number in SIGNALS:
            signal.signal(number, signal.default_int_handler)
        if deferred.pending:
            raise KeyboardInterrupt
        yield
    finally:
        for number in SIGNALS:
            signal.signal(number, deferred)


@contextmanager
def blocked_interrupts() -> Iterator[None]:
    """Blocks Ctrl-C in processes started within the block, although the terminal sends it to all.

    This process receives a Ctrl-C that came during the block when the block ends.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def termination_as_interrupt() -> Iterator[None]:
    """Makes SIGTERM raise KeyboardInterrupt, as Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
