"""The loop between robot and server: what pages ask for, and what comes back, without a server."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from gains import make_gains

from hexapod_cosim.cosim.scenario.scenario import load_scenario, scenario_from_table
from hexapod_cosim.extensions.live.loop import Loop
from hexapod_cosim.extensions.live.protocol import Action, Change, Drive, Ping, Push
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import Choices, control_texts
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.schema import parse_toml

FORWARD = Drive(forward=1.0, speed=0.3, stamp=5.0)


class Side:
    """The server's side of a link, and the wall clock [s] of the loop."""

    def __init__(self) -> None:
        self.waiting: deque[Any] = deque()
        self.sent: list[tuple[str, Any]] = []
        self.time = 0.0
        self.takes = True  # whether each frame is taken at once

    def poll(self, timeout: float = 0.0) -> bool:
        if not self.waiting:
            self.time += timeout
        return bool(self.waiting)

    def recv(self) -> Any:
        return self.waiting.popleft()

    def send(self, message: Any) -> None:
        self.sent.append(message)
        if self.takes and message[0] == "frame":
            self.post("taken", 0, 1)

    def post(self, kind: str, client: int, content: Any) -> None:
        self.waiting.append((kind, client, content))

    def pause(self, seconds: float) -> None:
        self.time += seconds

    def frames(self) -> list[dict[str, Any]]:
        return [content for kind, content in self.sent if kind == "frame"]

    def last(self, kind: str) -> Any:
        return next(content for name, content in reversed(self.sent) if name == kind)


@pytest.fixture(scope="module")
def robot() -> Iterator[LiveRobot]:
    scenario = load_scenario("walk_flat")
    choices = Choices(scenario, control_texts(scenario), {})
    with LiveRobot(choices, gains=make_gains(load_robot("athena"))) as made:
        yield made


@pytest.fixture
def side() -> Side:
    return Side()


@pytest.fixture
def loop(robot: LiveRobot, side: Side) -> Loop:
    """A loop with a robot at its start and one page."""
    robot.place(robot.choices.first())
    made = Loop(robot, side, now=lambda: side.time, pause=side.pause)
    side.post("clients", 0, 1)
    return made


def turn(loop: Loop, count: int) -> None:
    for _ in range(count):
        loop.turn()


def test_without_a_page_the_robot_stands_still_and_with_one_it_goes_on(
    loop: Loop, side: Side
) -> None:
    turn(loop, 10)
    assert loop.robot.count == 10
    side.post("clients", 0, 0)
    turn(loop, 100)
    assert loop.robot.count == 10
    side.post("clients", 0, 1)
    turn(loop, 10)
    assert loop.robot.count >= 19
    assert loop.pacer.lateness.gaps == 0
    assert loop.pacer.lateness.misses == 0


def test_a_page_gets_robot_ground_settings_and_fifty_frames_a_second(
    loop: Loop, side: Side
) -> None:
    turn(loop, 200)
    world, status, frames = side.last("world"), side.last("status"), side.frames()
    assert len(world["robot"]["legs"]) == 6
    assert world["ground"] == {"height": 0.0, "rise": 0.0, "heading": 0.0}
    assert status["settings"]["gait"] == "tripod"
    assert len(frames) == 50
    assert sum(frames[0]["force"][2::3]) == pytest.approx(1.0, abs=0.02)  # body weights
    assert frames[-1]["factor"] == pytest.approx(1.0)
    assert [kind for kind, _ in side.sent].count("status") == 1


def test_a_drive_moves_the_robot_and_its_stamp_comes_back_once(loop: Loop, side: Side) -> None:
    for _ in range(40):
        side.post("drive", 7, FORWARD)
        turn(loop, 10)
    assert side.frames()[-1]["position"][0] > 0.05
    assert side.frames()[-1]["driver"] == 7
    assert side.frames()[-1]["command"][0] == pytest.approx(0.3 * loop.robot.limits.vx, abs=1e-5)
    side.post("ping", 3, Ping(99.0))
    turn(loop, 8)
    assert [frame["echo"].get("3") for frame in side.frames()[-2:]] == [99.0, None]


def test_the_last_of_two_pages_that_drive_has_the_robot(loop: Loop, side: Side) -> None:
    side.post("drive", 1, FORWARD)
    side.post("drive", 2, Drive(turn=1.0, speed=0.5))
    turn(loop, 4)
    assert side.frames()[-1]["driver"] == 2
    assert side.frames()[-1]["command"][0] == 0.0
    side.post("drive", 1, FORWARD)
    turn(loop, 4)
    assert side.frames()[-1]["driver"] == 1
    # the page that does not drive is closed: nothing changes; then the driver is
    side.post("left", 2, None)
    turn(loop, 4)
    assert side.frames()[-1]["command"][0] > 0.0
    side.post("left", 1, None)
    turn(loop, 4)
    assert side.frames()[-1]["command"][0] == 0.0


def test_a_page_that_falls_silent_stops_the_robot_and_lets_go_of_it(loop: Loop, side: Side) -> None:
    side.post("drive", 1, Drive(forward=1.0, height=0.5, speed=0.3))
    side.post("push", 1, Push((0.0, 5.0, 0.0)))
    turn(loop, 100)
    assert side.frames()[-1]["command"][0] > 0.0
    assert side.frames()[-1]["push"] == [0.0, 5.0, 0.0]
    turn(loop, 120)
    frame = side.frames()[-1]
    assert frame["command"][:3] == [0.0, 0.0, 0.0]
    assert frame["command"][3] > 0.0  # its height stays
    assert frame["push"] == [0.0, 0.0, 0.0]


def test_a_push_is_limited_to_three_weights_whatever_a_page_asks_for(
    loop: Loop, side: Side
) -> None:
    side.post("push", 1, Push((0.0, 1e6, 0.0)))
    turn(loop, 4)
    assert side.frames()[-1]["push"][1] == pytest.approx(3.0 * loop.robot.weight, abs=1e-3)


def test_a_server_that_takes_nothing_gets_two_frames_and_slows_nothing(
    loop: Loop, side: Side
) -> None:
    side.takes = False
    turn(loop, 400)
    assert len(side.frames()) == 2
    assert loop.robot.count == 400
    side.post("taken", 0, 2)
    turn(loop, 4)
    assert side.frames()[-1]["time"] == pytest.approx(404 * 0.005)  # the newest, not the next


def test_a_flood_of_messages_does_not_keep_the_robot_from_walking(loop: Loop, side: Side) -> None:
    for _ in range(100_000):
        side.waiting.append(("push", 1, Push()))
    turn(loop, 50)
    assert loop.robot.count == 50


def test_a_gap_of_wall_time_is_told_and_not_caught_up(loop: Loop, side: Side) -> None:
    turn(loop, 100)
    side.time += 30.0
    before = side.time
    turn(loop, 100)
    assert side.time - before == pytest.approx(0.5, abs=0.02)
    assert side.frames()[-1]["gaps"] == 1
    assert side.frames()[-1]["skipped"] == pytest.approx(30.0, abs=0.02)


def test_pause_and_resume(loop: Loop, side: Side) -> None:
    turn(loop, 10)
    side.post("do", 1, Action("pause"))
    turn(loop, 10)
    assert loop.robot.count == 10
    assert side.last("status")["paused"]
    side.post("do", 1, Action("resume"))
    turn(loop, 10)
    assert loop.robot.count == 20
    assert not side.last("status")["paused"]


def test_what_is_refused_is_told_to_all_pages_and_changes_nothing(loop: Loop, side: Side) -> None:
    side.post("set", 1, Change("gait", "trpod"))
    side.post("do", 1, Action("replay"))
    turn(loop, 4)
    status = side.last("status")
    assert status["settings"]["gait"] == "tripod"
    assert [note for _, note in status["notes"]] == [
        "unknown gait: got 'trpod', expected one of tripod, ripple, wave, amble; "
        "did you mean 'tripod'?",
        "Nothing is recorded yet: press Record, drive, and press Stop.",
    ]


def test_what_was_recorded_is_replayed_and_saved_as_the_same_walk(loop: Loop, side: Side) -> None:
    turn(loop, 30)
    side.post("do", 1, Action("record"))
    for _ in range(20):
        side.post("drive", 1, FORWARD)
        turn(loop, 10)
    assert side.last("status")["mode"] == "recording"
    side.post("do", 1, Action("stop"))
    first = loop.robot.signals.values.copy()
    turn(loop, 4)
    assert side.last("status")["recorded"]
    scenario = scenario_from_table(parse_toml(side.last("take")), where="driven.toml")
    assert scenario.duration == pytest.approx(1.0)
    assert scenario.commands[-1].vx == pytest.approx(0.3 * loop.robot.limits.vx)
    side.post("do", 1, Action("replay"))
    turn(loop, 200)
    assert (loop.robot.signals.values == first).all()
    turn(loop, 4)
    assert side.last("status")["mode"] == "free"


def test_a_recording_goes_on_over_changes_and_its_replay_repeats_them(
    loop: Loop, side: Side
) -> None:
    side.post("do", 1, Action("record"))
    for step, change in enumerate(
        [
            None,
            Change("gait", "tripod"),  # it is a tripod already: nothing changes
            Change("gait", "ripple"),
            Change("control", "compliant"),
            Change("friction", 0.4),
            Change("control", "paper"),
        ]
    ):
        if change is not None:
            side.post("set", 1, change)
        for _ in range((25, 25, 150, 50, 50, 50)[step]):
            side.post("drive", 1, FORWARD)
            turn(loop, 2)
    assert side.last("status")["mode"] == "recording"
    side.post("do", 1, Action("stop"))
    first, pose = loop.robot.settings, loop.robot.signals.values.copy()
    assert (first.gait, first.control, first.friction) == ("ripple", "paper", 0.4)
    turn(loop, 4)
    notes = [note for _, note in side.last("status")["notes"]]
    assert notes == [
        "Recorded 3.5 s.",
        "Replay repeats all of it, Save gives the 0.5 s before the first change of gait, control or"
        " friction.",
    ]
    scenario = scenario_from_table(parse_toml(side.last("take")), where="driven.toml")
    assert scenario.duration == pytest.approx(0.5)
    side.post("do", 1, Action("replay"))
    turn(loop, 1)
    assert loop.robot.settings.control == "kinematic"
    turn(loop, 699)
    assert (loop.robot.signals.values == pose).all()
    assert loop.robot.settings == first
    turn(loop, 4)
    assert side.last("status")["mode"] == "free"


def test_a_recording_that_begins_with_a_change_is_replayed_and_gives_no_scenario(
    loop: Loop, side: Side
) -> None:
    side.post("do", 1, Action("record"))
    side.post("set", 1, Change("friction", 0.4))
    turn(loop, 60)
    side.post("do", 1, Action("stop"))
    turn(loop, 4)
    assert side.last("take") == ""
    assert side.last("status")["recorded"]
    side.post("do", 1, Action("replay"))
    turn(loop, 10)
    assert loop.robot.settings.friction == 0.4


def test_another_ground_ends_a_recording(loop: Loop, side: Side) -> None:
    side.post("do", 1, Action("record"))
    turn(loop, 20)
    side.post("set", 1, Change("ground", "flat"))
    turn(loop, 4)
    assert side.last("status")["mode"] == "free"
    assert [note for _, note in side.last("status")["notes"]] == ["Recorded 0.1 s."]


STANDS = """
import numpy as np


class Stands:
    def __init__(self, robot):
        self.stance = np.array(robot.stance)

    def step(self, t, command, measurement):
        return self.stance
"""


def test_a_change_that_needs_a_stand_is_told_to_all_pages(side: Side, tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(STANDS, encoding="utf-8")
    scenario = load_scenario("walk_flat")
    texts = control_texts(scenario, ("kinematic",)) | {"Stands": f"{tmp_path / 'law.py'}:Stands"}
    with LiveRobot(Choices(scenario, texts, {})) as robot:
        loop = Loop(robot, side, now=lambda: side.time, pause=side.pause)
        side.post("clients", 0, 1)
        side.post("set", 1, Change("gait", "ripple"))
        turn(loop, 10)
        assert side.last("status")["notes"] == []  # it walks on
        side.post("set", 1, Change("control", "Stands"))
        turn(loop, 10)
        assert [note for _, note in side.last("status")["notes"]] == [
            "The robot stops, and walks on with Stands: only built-in controls take over a walk "
            "without a stop."
        ]


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


def test_a_controller_that_raises_is_told_to_all_pages_and_the_loop_goes_on(
    side: Side, tmp_path: Path
) -> None:
    (tmp_path / "law.py").write_text(FAILING, encoding="utf-8")
    scenario = load_scenario("stand", overrides=[f"control={tmp_path / 'law.py'}:Fails"])
    with LiveRobot(Choices(scenario, control_texts(scenario, ("kinematic",)), {})) as robot:
        loop = Loop(robot, side, now=lambda: side.time, pause=side.pause)
        side.post("clients", 0, 1)
        side.post("do", 1, Action("record"))
        turn(loop, 100)
        status = side.last("status")
        assert robot.count == 100
        assert "ZeroDivisionError: no legs left" in status["fault"]
        assert [note for _, note in status["notes"]] == ["Recorded 0.1 s.", status["fault"]]
        assert not status["stopped"]
        assert status["mode"] == "free"
        side.post("set", 1, Change("control", "kinematic"))
        turn(loop, 20)
        assert side.last("status")["fault"] == ""
        assert side.last("status")["settings"]["control"] == "kinematic"
        side.post("drive", 1, FORWARD)
        turn(loop, 8)
        assert side.frames()[-1]["command"][0] > 0.0


def test_the_loop_ends_when_the_server_says_so_and_when_it_is_gone(loop: Loop, side: Side) -> None:
    side.post("end", 0, None)
    loop.run()
    assert loop.ended

    class Gone(Side):
        def poll(self, timeout: float = 0.0) -> bool:
            raise BrokenPipeError

    Loop(loop.robot, Gone()).run()
