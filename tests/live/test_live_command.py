"""What `hexapod live` and `hexapod realtime` design gains for: the robot as it walks there."""

from __future__ import annotations

from typing import Any

import pytest
from command import Call, assert_refused
from gains import make_gains

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.run import preparation
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.extensions.live import realtime, server
from hexapod_cosim.extensions.live.settings import Choices
from hexapod_cosim.models import HexapodError, Robot

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

    monkeypatch.setattr(preparation, "designed_gains", design)
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
    assert designed == [preparation.design_key(load_scenario("rubble", overrides=NAMED))]


def test_realtime_designs_gains_for_the_walk_that_it_measures(
    call: Call, monkeypatch: pytest.MonkeyPatch, designed: Keys
) -> None:
    def measure(*_scenario: Any, **_options: Any) -> None:
        raise HexapodError("enough")

    monkeypatch.setattr(realtime, "measure", measure)
    assert call("realtime", "rubble", "--control", "compliant", "--step", "0.005")[0] == 1
    assert designed == [preparation.design_key(load_scenario("rubble", overrides=NAMED))]


def test_a_port_out_of_range_is_refused(call: Call) -> None:
    words = ["--no-browser", "--port", "99999"]
    assert_refused(call("live", *words), "got 99999", "from 1 to 65535")
