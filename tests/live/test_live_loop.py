"""Tests the loop of a live robot, and the messages of a page that it reads."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from gains import make_gains
from hypothesis import given
from hypothesis import strategies as st

from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_from_table
from hexapod_cosim.extensions.live.loop import Loop
from hexapod_cosim.extensions.live.messages import (
    Action,
    Change,
    Drive,
    Leg,
    MessageError,
    Push,
    read_message,
)
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import Choices, control_texts
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.files import parse_toml

FORWARD = Drive(forward=1.0, speed=0.3)


class Side:
    """The pages' side of a loop, and its wall clock [s]."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, Any]] = []
        self.time = 0.0

    def publish(self, kind: str, content: Any) -> None:
        self.sent.append((kind, content))

    def pause(self, seconds: float) -> None:
        self.time += seconds

    def all(self, kind: str) -> list[Any]:
        return [content for name, content in self.sent if name == kind]

    def last(self, kind: str) -> Any:
        return self.all(kind)[-1]

    def notes(self) -> list[str]:
        return [content["text"] for content in self.all("note")]


@pytest.fixture(scope="module")
def robot() -> Iterator[LiveRobot]:
    scenario = load_scenario("walk_flat")
    choices = Choices(scenario, control_texts(scenario), {})
    with LiveRobot(choices, gains=make_gains(load_robot("athena"))) as made:
        yield made


@pytest.fixture
def side() -> Side:
    return Side()


def looped(robot: LiveRobot, side: Side) -> Loop:
    """Returns a loop with one page."""
    made = Loop(robot, side.publish, now=lambda: side.time, pause=side.pause)
    made.pages = 1
    return made


@pytest.fixture
def loop(robot: LiveRobot, side: Side) -> Loop:
    """A loop with a robot at its start and one page."""
    robot.place(robot.choices.first())
    return looped(robot, side)


def turn(loop: Loop, count: int) -> None:
    for _ in range(count):
        loop.turn()


def test_without_a_page_or_in_a_pause_the_robot_stands_still(loop: Loop, side: Side) -> None:
    turn(loop, 10)
    loop.pages = 0
    turn(loop, 100)
    assert loop.robot.count == 10
    loop.pages = 1
    loop.post(Action("pause"))
    turn(loop, 10)
    assert loop.robot.count == 10
    assert side.last("status")["paused"]
    loop.post(Action("resume"))
    turn(loop, 10)
    assert loop.robot.count == 20
    assert loop.pacer.skipped == 0.0


def test_a_page_gets_settings_once_and_fifty_frames_a_second(loop: Loop, side: Side) -> None:
    loop.post(Action("place"))
    turn(loop, 200)
    world, frames = side.last("world"), side.all("frame")[1:]
    assert len(world["robot"]["legs"]) == 6
    assert world["ground"] == {"height": 0.0, "rise": 0.0, "heading": 0.0}
    assert [status["settings"]["gait"] for status in side.all("status")] == ["tripod"]
    assert len(frames) == 50
    assert sum(frames[0]["force"][2::3]) == pytest.approx(1.0, abs=0.02)  # body weights
    assert frames[-1]["late"]["factor"] == pytest.approx(1.0)


def test_the_last_drive_moves_the_robot_until_its_page_falls_silent(loop: Loop, side: Side) -> None:
    loop.post(Drive(turn=1.0))
    loop.post(Drive(forward=1.0, height=0.5, speed=0.3))
    loop.post(Push(y=5.0))
    turn(loop, 100)
    frame = side.last("frame")
    assert frame["command"][0] == pytest.approx(0.3 * loop.robot.limits.vx, abs=1e-5)
    assert frame["command"][2] == 0.0
    assert frame["push"] == [0.0, 5.0, 0.0]
    turn(loop, 120)
    frame = side.last("frame")
    assert frame["command"][:3] == [0.0, 0.0, 0.0]
    assert frame["command"][3] > 0.0  # its height stays
    assert frame["push"] == [0.0, 0.0, 0.0]


def test_pages_are_told_which_leg_the_controller_walks_without(loop: Loop, side: Side) -> None:
    loop.robot.place(replace(loop.robot.choices.first(), control="compliant"))
    for note in (
        ("Leg LM is limp.", "The controller walks without leg LM."),
        ("Leg LM works again.", "The controller walks with leg LM."),
    ):
        side.sent.clear()
        loop.post(Leg(1))
        for _ in range(10):
            loop.post(FORWARD)
            turn(loop, 100)
        assert side.notes() == list(note)


def test_a_push_is_limited_to_three_weights_whatever_a_page_asks_for(
    loop: Loop, side: Side
) -> None:
    loop.post(Push(y=1e6))
    turn(loop, 4)
    assert side.last("frame")["push"][1] == pytest.approx(3.0 * loop.robot.weight, abs=1e-3)


def test_a_flood_of_messages_does_not_keep_the_robot_from_walking(loop: Loop) -> None:
    for _ in range(10_000):
        loop.post(Push())
    turn(loop, 50)
    assert loop.robot.count == 50


def test_a_gap_of_wall_time_is_shown_and_not_made_up(loop: Loop, side: Side) -> None:
    turn(loop, 100)
    side.time += 30.0
    before = side.time
    turn(loop, 100)
    assert side.time - before == pytest.approx(0.5, abs=0.02)
    assert side.last("frame")["late"]["skipped"] == pytest.approx(30.0, abs=0.02)


def test_why_a_change_was_refused_is_shown_and_nothing_changes(loop: Loop, side: Side) -> None:
    loop.post(Change("gait", "trpod"))
    turn(loop, 4)
    assert side.last("status")["settings"]["gait"] == "tripod"
    assert side.notes() == [
        "unknown gait: got 'trpod', expected one of tripod, ripple, wave, amble; "
        "did you mean 'tripod'?"
    ]


def test_what_was_recorded_is_saved_as_a_scenario(loop: Loop, side: Side) -> None:
    turn(loop, 30)
    loop.post(Action("record"))
    loop.post(FORWARD)
    turn(loop, 100)
    assert (loop.robot.count, side.last("status")["recording"]) == (100, True)
    loop.post(Action("stop"))
    turn(loop, 4)
    assert (side.last("status")["recording"], side.last("status")["recorded"]) == (False, True)
    scenario = scenario_from_table(parse_toml(side.last("recording")), where="driven.toml")
    assert scenario.duration == pytest.approx(0.5)
    assert scenario.commands[-1].vx == pytest.approx(0.3 * loop.robot.limits.vx)
    assert side.notes() == ["Recorded 0.5 s."]


@pytest.mark.parametrize("change", [Change("ground", "flat"), Change("friction", 0.4)])
def test_a_change_ends_a_recording(loop: Loop, side: Side, change: Change) -> None:
    loop.post(Action("record"))
    turn(loop, 20)
    loop.post(Change("gait", "tripod"))  # it is a tripod already: nothing changes
    turn(loop, 4)
    assert side.last("status")["recording"]
    loop.post(change)
    turn(loop, 4)
    assert not side.last("status")["recording"]
    assert side.notes() == ["Recorded 0.1 s."]


FAILING = """
import numpy as np


class Fails:
    def __init__(self, robot, period):
        self.stance = np.array(robot.stance)
        self.left = 20

    def step(self, t, command, measurement):
        self.left -= 1
        if self.left < 0:
            raise ZeroDivisionError("no legs left")
        return self.stance
"""


def test_a_controller_that_raises_is_shown_and_the_loop_goes_on(side: Side, tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(FAILING, encoding="utf-8")
    scenario = load_scenario("stand", overrides=[f"control={tmp_path / 'law.py'}:Fails"])
    with LiveRobot(Choices(scenario, control_texts(scenario, ("kinematic",)), {})) as robot:
        loop = looped(robot, side)
        loop.post(Action("record"))
        turn(loop, 100)
        status = side.last("status")
        assert robot.count == 100
        assert "ZeroDivisionError: no legs left" in status["fault"]
        assert side.notes() == ["Recorded 0.1 s.", status["fault"]]
        assert (status["stopped"], status["recording"]) == (False, False)
        loop.post(Change("control", "kinematic"))
        turn(loop, 20)
        assert side.last("status")["fault"] == ""
        assert side.last("status")["settings"]["control"] == "kinematic"


# Messages of a page: what is read, and that all else is refused.


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"type": "drive", "forward": 1, "speed": 0.5}', Drive(forward=1, speed=0.5)),
        ('{"type": "push", "y": -5.5}', Push(y=-5.5)),
        ('{"type": "set", "key": "gait", "value": "wave"}', Change("gait", "wave")),
        ('{"type": "set", "key": "friction", "value": 0.4}', Change("friction", 0.4)),
        (b'{"type": "do", "action": "record"}', Action("record")),
        ('{"type": "leg", "leg": 5}', Leg(5)),
    ],
)
def test_each_kind_of_message_is_read(text: str | bytes, message: object) -> None:
    assert read_message(text) == message


@pytest.mark.parametrize(
    "text",
    [
        "nonsense",
        b"\xff\x00",
        "[1]",
        "{}",
        '{"type": "fly"}',
        '{"type": ["drive"]}',
        '{"type": "drive", "forward": 1.5}',
        '{"type": "drive", "forward": true}',
        '{"type": "drive", "forward": NaN}',
        '{"type": "drive", "speed": -0.1}',
        '{"type": "drive", "jump": 1}',
        '{"type": "push", "x": "5"}',
        '{"type": "push", "x": 1e300}',
        '{"type": "set", "key": "mass", "value": "1"}',
        '{"type": "set", "key": "gait", "value": 1}',
        '{"type": "set", "key": "friction", "value": -1}',
        '{"type": "do", "action": "jump"}',
        '{"type": "leg", "leg": 6}',
        "[" * 4000,
    ],
)
def test_what_is_no_message_is_refused(text: str | bytes) -> None:
    with pytest.raises(MessageError, match=r"not a message of the page: got .* expected JSON"):
        read_message(text)


@given(st.text() | st.binary())
def test_any_text_is_read_or_refused(text: str | bytes) -> None:
    with suppress(MessageError):
        read_message(text)
