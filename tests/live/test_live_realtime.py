"""Tests walks in time with the clock: pacing, the histogram of doStep, and what hexapod live and
hexapod realtime design gains for.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import Call, assert_refused
from gains import make_gains

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.run import plan
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.extensions.live import realtime, server
from hexapod_cosim.extensions.live.loop import Pacer
from hexapod_cosim.extensions.live.realtime import facts_of, measure
from hexapod_cosim.extensions.live.settings import Choices
from hexapod_cosim.models import HexapodError, Robot


def test_figures_are_quantiles_by_clock() -> None:
    thread = np.array([400.0, 20.0, *np.linspace(10.0, 30.0, 998)])
    facts = facts_of({"thread time": thread, "wall time": 2.0 * thread}, 0.001)
    assert facts["steps"] == 1000
    found = facts["times"]["thread time"]
    assert found["50 %"] == pytest.approx(20.0, abs=0.1)
    assert found["largest"] == 400.0
    assert facts["times"]["wall time"]["largest"] == 800.0


def test_a_walk_is_timed_step_by_step() -> None:
    times = measure(load_scenario("walk_flat"), step=0.001, count=1000)
    assert len(times["thread time"]) == len(times["wall time"]) == 1000
    assert times["thread time"].min() > 0.0


def test_too_few_steps_are_refused() -> None:
    with pytest.raises(HexapodError, match="too few steps: got 10, expected at least 1000"):
        measure(load_scenario("walk_flat"), step=0.001, count=10)


def test_the_command_prints_its_figures_and_writes_the_histogram(
    call: Call, tmp_path: Path
) -> None:
    options = ["--control", "kinematic", "--steps", "1000", "-o", tmp_path, "--json"]
    code, out, err = call("realtime", "stand", *options)
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert facts["steps"] == 1000
    assert facts["written"] == [str(tmp_path / f"realtime.{kind}") for kind in ("png", "svg")]
    assert all(Path(name).stat().st_size > 0 for name in facts["written"])


# Keeping macro-steps in step with wall time, on a clock that the test moves.

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


def test_short_steps_run_in_real_time(clock: Clock, pacer: Pacer) -> None:
    clock.run(pacer, 1000, taking=0.001)
    assert clock.time == pytest.approx(100.0 + 999 * H + 0.001)
    assert pacer.factor == pytest.approx(1.0)
    assert (pacer.steps, pacer.skipped) == (1000, 0.0)


def test_a_long_step_is_made_up_without_a_pause(clock: Clock, pacer: Pacer) -> None:
    clock.run(pacer, 10, taking=0.001)
    clock.run(pacer, 1, taking=0.022)
    # it ends 17 ms late; each step makes up 4 ms: the ones after it end 13, 9, 5 and 1 ms late
    clock.run(pacer, 10, taking=0.001)
    assert clock.time == pytest.approx(100.0 + 20 * H + 0.001)


def test_a_sleeping_computer_is_one_gap_that_is_skipped_and_not_caught_up(
    clock: Clock, pacer: Pacer
) -> None:
    clock.run(pacer, 100, taking=0.001)
    clock.time += 3600.0
    before = clock.time
    clock.run(pacer, 200, taking=0.001)
    assert pacer.skipped == pytest.approx(3600.0, abs=H)
    # the steps after the gap take as long as before it
    assert clock.time - before == pytest.approx(199 * H + 0.001)


def test_steps_that_always_take_too_long_lower_the_factor(clock: Clock, pacer: Pacer) -> None:
    clock.run(pacer, 1000, taking=2.0 * H)
    assert pacer.factor == pytest.approx(0.5)
    # wall time is simulated, skipped, or still made up: 0.1 s at the most
    assert clock.time - 100.0 - 1000 * H == pytest.approx(pacer.skipped, abs=0.1 + H)


def test_a_pause_that_was_asked_for_is_not_skipped(clock: Clock, pacer: Pacer) -> None:
    clock.run(pacer, 10, taking=0.001)
    clock.time += 60.0
    pacer.restart()
    assert pacer.wait() == 0.0
    clock.run(pacer, 10, taking=0.001)
    assert pacer.skipped == 0.0
    assert pacer.factor == pytest.approx(1.0)


# What `hexapod live` and `hexapod realtime` design gains for: the robot as it walks there.

Keys = list[tuple[Robot, float]]
# a recording on rubble names the gait, so compliant control does not choose another stance in it
NAMED = ["control=compliant", "gait.name=tripod"]


@pytest.fixture
def designed(monkeypatch: pytest.MonkeyPatch) -> Keys:
    """Robots and periods [s] that gains are designed for."""
    keys: Keys = []

    def design(robot: Robot, period: float) -> Gains:
        keys.append((robot, period))
        return make_gains(robot, period=period)

    monkeypatch.setattr(plan, "designed_gains", design)
    return keys


def test_live_designs_gains_for_the_walk_that_a_recording_names(
    call: Call, monkeypatch: pytest.MonkeyPatch, designed: Keys
) -> None:
    class Server:
        def __init__(self, choices: Choices, gains: Gains | None, *, port: int) -> None:
            first = choices.first()
            assert (first.control, first.gait, port) == ("compliant", "tripod", 0)
            assert gains is not None

        def run(self, ready: Any) -> None:
            ready("http://127.0.0.1:1/token/")

    monkeypatch.setattr(server, "LiveServer", Server)
    code, out, _ = call("live", "rubble", "--control", "compliant", "--no-browser")
    assert (code, "stopped" in out) == (0, True)
    assert designed == [plan.design_key(load_scenario("rubble", overrides=NAMED))]


def test_realtime_designs_gains_for_the_walk_that_it_measures(
    call: Call, monkeypatch: pytest.MonkeyPatch, designed: Keys
) -> None:
    def measure(*_scenario: Any, **_options: Any) -> None:
        raise HexapodError("enough")

    monkeypatch.setattr(realtime, "measure", measure)
    assert call("realtime", "rubble", "--control", "compliant", "--step", "0.005")[0] == 1
    assert designed == [plan.design_key(load_scenario("rubble", overrides=NAMED))]


def test_a_port_out_of_range_is_refused(call: Call) -> None:
    words = ["--no-browser", "--port", "99999"]
    assert_refused(call("live", *words), "got 99999", "from 1 to 65535")
    words[words.index("99999")] = "abc"
    assert_refused(call("live", *words), "Invalid value 'abc' for '--port'", "live --help")
