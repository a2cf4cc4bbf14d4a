"""Gains that `hexapod live` and `hexapod realtime` design for the robot as it walks."""

from __future__ import annotations

from typing import Any

import pytest
from command import Call

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.live import realtime, server
from hexapod_cosim.cosim.live.settings import Choices
from hexapod_cosim.cosim.run.preparation import chosen_gains
from hexapod_cosim.cosim.scenario.scenario import load_scenario
from hexapod_cosim.models import HexapodError

NAMED = ["control=compliant", "gait.name=tripod"]  # what a recording on rubble names


def test_live_designs_gains_for_the_walk_that_a_recording_names(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Gains | None] = []

    class Server:
        def __init__(self, choices: Choices, gains: Gains | None, *, port: int) -> None:
            assert (choices.first().control, choices.first().gait) == ("compliant", "tripod")
            given.append(gains)

        def run(self, ready: Any) -> None:
            ready("http://127.0.0.1:1/token/")

    monkeypatch.setattr(server, "LiveServer", Server)
    code, out, _ = call("live", "rubble", "--control", "compliant", "--no-browser")
    assert (code, "stopped" in out) == (0, True)
    assert given == [chosen_gains(load_scenario("rubble", overrides=NAMED))]
    assert given != [chosen_gains(load_scenario("rubble", overrides=NAMED[:1]))]


def test_realtime_designs_gains_for_the_walk_that_it_measures(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Gains | None] = []

    def measure(scenario: Any, *, gains: Gains | None, **_options: Any) -> None:
        given.append(gains)
        raise HexapodError("enough")

    monkeypatch.setattr(realtime, "measure", measure)
    assert call("realtime", "rubble", "--control", "compliant", "--step", "0.005")[0] == 1
    assert given == [chosen_gains(load_scenario("rubble", overrides=NAMED))]
