"""Keeping macro-steps in step with wall time, on a clock that the test moves."""

from __future__ import annotations

import pytest

from hexapod_cosim.extensions.live.pacing import Pacer

H = 0.005  # s


class Clock:
    """Wall time [s] that the test moves."""

    def __init__(self) -> None:
        self.time = 100.0

    def __call__(self) -> float:
        return self.time

    def run(self, pacer: Pacer, steps: int, *, taking: float) -> None:
        """Makes steps of `taking` [s] each when they are due."""
        for _ in range(steps):
            self.time += pacer.wait()
            self.time += taking
            pacer.note_step()


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def pacer(clock: Clock) -> Pacer:
    return Pacer(H, clock)


def test_short_steps_run_in_real_time_and_none_is_late(clock: Clock, pacer: Pacer) -> None:
    clock.run(pacer, 1000, taking=0.001)
    assert clock.time == pytest.approx(100.0 + 999 * H + 0.001)
    assert pacer.factor == pytest.approx(1.0)
    assert (pacer.lateness.steps, pacer.lateness.misses) == (1000, 0)


def test_a_long_step_is_counted_and_made_up_without_a_pause(clock: Clock, pacer: Pacer) -> None:
    clock.run(pacer, 10, taking=0.001)
    clock.run(pacer, 1, taking=0.022)
    # it ends 17 ms late; each step makes up 4 ms: the ones after it end 13, 9, 5 and 1 ms late
    clock.run(pacer, 10, taking=0.001)
    assert pacer.lateness.misses == 5
    assert pacer.lateness.worst == pytest.approx(0.017)
    assert clock.time == pytest.approx(100.0 + 20 * H + 0.001)


def test_a_sleeping_computer_is_one_gap_that_is_skipped_and_not_caught_up(
    clock: Clock, pacer: Pacer
) -> None:
    clock.run(pacer, 100, taking=0.001)
    clock.time += 3600.0
    before = clock.time
    clock.run(pacer, 200, taking=0.001)
    late = pacer.lateness
    assert late.skipped == pytest.approx(3600.0, abs=H)
    assert late.misses == 0
    # the steps after the gap take as long as before it
    assert clock.time - before == pytest.approx(199 * H + 0.001)


def test_steps_that_take_too_long_all_the_time_are_all_counted(clock: Clock, pacer: Pacer) -> None:
    clock.run(pacer, 1000, taking=2.0 * H)
    late = pacer.lateness
    assert late.misses == 1000
    assert pacer.factor == pytest.approx(0.5)
    # wall time is simulated, skipped, or still made up: 0.1 s at the most
    assert clock.time - 100.0 - 1000 * H == pytest.approx(late.skipped, abs=0.1 + H)


def test_a_pause_that_was_asked_for_is_no_lateness(clock: Clock, pacer: Pacer) -> None:
    clock.run(pacer, 10, taking=0.001)
    clock.time += 60.0
    pacer.restart()
    assert pacer.wait() == 0.0
    clock.run(pacer, 10, taking=0.001)
    assert (pacer.lateness.skipped, pacer.lateness.misses) == (0.0, 0)
    assert pacer.factor == pytest.approx(1.0)
