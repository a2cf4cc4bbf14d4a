"""When Ctrl-C and SIGTERM may strike: not while what was recorded is on its way to the disk."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class _Hold:
    """A signal handler that only remembers."""

    pending = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self.pending = True


@contextmanager
def held_interrupts() -> Iterator[None]:
    """Keeps an interrupt back until the block has ended well; only Python's main thread receives
    any. Raises KeyboardInterrupt then.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    hold = _Hold()
    before = {number: signal.signal(number, hold) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if hold.pending:
        raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[None]:
    """A part within `held_interrupts` that an interrupt does end, one that was kept back before
    it too. Raises KeyboardInterrupt.
    """
    hold = signal.getsignal(signal.SIGINT)
    if not isinstance(hold, _Hold):
        yield
        return
    try:
        for number in SIGNALS:
            signal.signal(number, signal.default_int_handler)
        if hold.pending:
            raise KeyboardInterrupt
        yield
    finally:
        for number in SIGNALS:
            signal.signal(number, hold)


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Processes begun within the block never hear Ctrl-C, which a terminal sends to all of them;
    this one hears it when the block ends.
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
    """SIGTERM does what Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
