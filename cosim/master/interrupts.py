"""Controls where Ctrl-C and SIGTERM may interrupt: not while a recording is being written. Ends
calls of a controller that take too long.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
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


class _RememberedSignal:
    """A signal handler that raises KeyboardInterrupt, and records that it did."""

    arrived = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self.arrived = True
        raise KeyboardInterrupt

    def check(self) -> None:
        """Raises KeyboardInterrupt if an interrupt has arrived."""
        if self.arrived:
            raise KeyboardInterrupt


@contextmanager
def remembered_interrupts() -> Iterator[Callable[[], None]]:
    """Yields a function that raises KeyboardInterrupt if an interrupt has arrived in the block.

    An interrupt in the block raises KeyboardInterrupt at once, as elsewhere. Python drops an
    exception, though, in a finaliser or in a callback of a weak reference or of the garbage
    collector, which libraries with threads have, and Ctrl-C with it. A loop that waits calls the
    function now and then, so that the interrupt is not lost. Handlers other than Python's own are
    left in place.
    """
    remembered = _RememberedSignal()
    is_main = threading.current_thread() is threading.main_thread()
    own = signal.default_int_handler
    replaced = [number for number in SIGNALS if is_main and signal.getsignal(number) is own]
    for number in replaced:
        signal.signal(number, remembered)
    try:
        yield remembered.check
    finally:
        for number in replaced:
            signal.signal(number, own)


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


class Watch:
    """Number of the call that is under way, from 1; 0: none."""

    call = 0


@contextmanager
def watched(limit: float) -> Iterator[Watch]:
    """Raises TimeoutError in a call that takes longer than `limit` [s of wall time].

    The block sets `call` of the watch before and after each call. A timer compares it once in
    `limit`, so that calls cost nothing and end after twice the limit at the latest. Has no effect
    in C code that does not return, under a debugger, outside Python's main thread, on systems
    without this timer, and where the program uses the timer itself.
    """
    watch, seen = Watch(), 0

    def compare(_number: int, _frame: FrameType | None) -> None:
        nonlocal seen
        if watch.call and watch.call == seen and sys.gettrace() is None:
            raise TimeoutError(f"the controller has not answered for {limit:g} s")
        seen = watch.call

    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or not hasattr(signal, "setitimer") or _has_timer():
        yield watch
        return
    before = signal.signal(signal.SIGALRM, compare)
    signal.setitimer(signal.ITIMER_REAL, limit, limit)
    try:
        yield watch
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _has_timer() -> bool:
    """Returns whether the program uses the timer."""
    return (
        signal.getsignal(signal.SIGALRM) is not signal.SIG_DFL
        or signal.getitimer(signal.ITIMER_REAL)[0] > 0.0
    )
