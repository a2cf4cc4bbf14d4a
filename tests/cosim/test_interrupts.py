"""Interrupts are neither lost in callbacks nor handled where they must wait."""

from __future__ import annotations

import gc
import signal
import sys
import threading
from collections.abc import Callable

import pytest

from hexapod_cosim.cosim.master.interrupts import deferred_interrupts, remembered_interrupts


def press(*_: object) -> None:
    """Presses Ctrl-C in this thread."""
    signal.raise_signal(signal.SIGINT)


def test_an_interrupt_in_a_callback_of_the_garbage_collector_is_raised_by_the_next_check(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    dropped: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda hook: dropped.append(hook.exc_type))
    with remembered_interrupts() as check:
        check()
        gc.callbacks.append(press)
        try:
            gc.collect()
        finally:
            gc.callbacks.remove(press)
        assert set(dropped) == {KeyboardInterrupt}
        with pytest.raises(KeyboardInterrupt):
            check()


def test_an_interrupt_elsewhere_is_raised_at_once() -> None:
    with pytest.raises(KeyboardInterrupt), remembered_interrupts():
        press()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_block_that_defers_interrupts_still_does() -> None:
    done = []

    def deferring() -> None:
        with remembered_interrupts(), deferred_interrupts():
            press()
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        deferring()
    assert done == [True]


@pytest.mark.parametrize("elsewhere", ["own handler", "thread"])
def test_handlers_of_the_program_and_threads_are_left_alone(elsewhere: str) -> None:
    seen: list[object] = []

    def own(*_: object) -> None:
        seen.append("own")

    def enter() -> None:
        with remembered_interrupts() as check:
            seen.append(signal.getsignal(signal.SIGINT))
            check()

    before = signal.signal(signal.SIGINT, own)
    try:
        started: Callable[[], None] = enter
        if elsewhere == "thread":
            thread = threading.Thread(target=enter)
            started = thread.start
        started()
        if elsewhere == "thread":
            thread.join()
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [own]
