"""A robot that is stepped and changed while it walks, without a clock and without a page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from gains import make_gains
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, make_gait
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.run.plan import RunPlan, chosen_gains
from hexapod_cosim.cosim.run.plant import initialise_plant
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.events import Push, ServoFault
from hexapod_cosim.cosim.scenario.reach import check_commands
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_from_table
from hexapod_cosim.cosim.scenario.records import Command
from hexapod_cosim.extensions.live import robot as live_robot
from hexapod_cosim.extensions.live.messages import Change, Drive
from hexapod_cosim.extensions.live.recording import NO_FORCE, Recording
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import (
    Choices,
    control_texts,
    find_limits,
    gait_of,
    live_scenario,
)
from hexapod_cosim.models import HexapodError, load_robot
from hexapod_cosim.models.files import parse_toml

WALK, STAND = BodyCommand(vx=0.08), BodyCommand()
ANGLES = joint_names("angle_ref")


@pytest.fixture(scope="module")
def robot() -> Iterator[LiveRobot]:
    scenario = load_scenario("walk_flat")
    choices = Choices(scenario, control_texts(scenario), {})
    with LiveRobot(choices, gains=make_gains(load_robot("athena"))) as made:
        yield made


@pytest.fixture
def placed(robot: LiveRobot) -> LiveRobot:
    """The robot at its start under the settings of the scenario."""
    robot.place(robot.choices.first())
    return robot


def value(robot: LiveRobot, *names: str) -> NDArray[np.float64]:
    found = dict(zip(robot.signals.names, robot.signals.values, strict=True))
    return np.array([found[name] for name in names])


def place_of(robot: LiveRobot) -> NDArray[np.float64]:
    return value(robot, *vector_names("torso.position"))


def go(robot: LiveRobot, steps: int, command: BodyCommand = WALK) -> NDArray[np.float64]:
    """Walks; returns the angles that the joints were commanded to (steps, 18) [rad]."""
    angles = []
    for _ in range(steps):
        robot.step(command, NO_FORCE)
        angles.append(value(robot, *ANGLES))
    return np.array(angles)


def test_a_live_walk_is_the_walk_of_simulate_bit_for_bit(placed: LiveRobot) -> None:
    scenario = load_scenario("walk_flat", overrides=["duration=1.0"])
    with Runner(everything=True) as runner:
        recording = runner.simulate(scenario).outcome.recording
    for row in range(200):
        present = value(placed, *recording.names[1:10])
        np.testing.assert_array_equal(present, recording.data[row, 1:10])
        placed.step(WALK, NO_FORCE)


def test_friction_changes_while_the_robot_walks_and_its_motion_goes_on(placed: LiveRobot) -> None:
    go(placed, 300)
    names = [*joint_names("angle"), *joint_names("speed"), *vector_names("torso.velocity")]
    before, time, begin = value(placed, *names), placed.time, place_of(placed)[0]
    placed.change(Change("friction", 0.3))
    np.testing.assert_allclose(value(placed, *names), before, rtol=0.0, atol=1e-9)
    assert (placed.time, placed.settings.friction) == (time, 0.3)
    go(placed, 300)
    assert place_of(placed)[0] - begin == pytest.approx(0.12, rel=0.1)
    assert placed.fault == ""


@pytest.mark.parametrize(("friction", "slides"), [(0.7, False), (0.1, True)])
def test_a_standing_robot_slides_when_the_push_exceeds_the_friction(
    placed: LiveRobot, friction: float, slides: bool
) -> None:
    placed.change(Change("friction", friction))
    for _ in range(40):
        placed.step(STAND, (0.0, 0.3 * placed.weight, 0.0))
    feet = value(placed, *(f"{leg}.foot.slip_speed" for leg in ("LM", "RM")))
    # (0.3 - 0.1) g for 0.2 s is 0.39 m/s; the friction of 0.7 holds all feet
    assert np.all((feet > 0.3) if slides else (feet < 0.01))


@pytest.mark.parametrize(
    ("first", "then", "gait"),
    [
        ("kinematic", "compliant", "tripod"),
        ("compliant", "paper", "amble"),
        ("paper", "kinematic", "tripod"),
    ],
)
def test_the_control_changes_at_once_while_the_robot_walks(
    placed: LiveRobot, first: str, then: str, gait: str
) -> None:
    placed.place(replace(placed.choices.first(), gait=gait, control=first))
    command = replace(WALK, vx=0.6 * placed.limits.vx)
    before = go(placed, 500, command)[-1:]
    begin = place_of(placed)[0]
    placed.change(Change("control", then))
    assert (placed.settings.control, placed.wanted) == (then, placed.settings)
    angles = go(placed, 400, command)
    # rad    in a macro-step: walks at these speeds need up to 0.023, compliant control adds up to
    # 0.004 when it lifts a foot that meets the ground early, and the paper's up to 0.018 when a
    # foot takes up its load
    assert np.abs(np.diff([*before, *angles], axis=0)).max() < 0.042
    assert place_of(placed)[0] - begin == pytest.approx(2.0 * command.vx, rel=0.08)
    assert placed.fault == ""


@pytest.mark.parametrize(
    ("first", "then", "control"),
    [
        ("tripod", "wave", "compliant"),
        ("wave", "tripod", "kinematic"),
        ("amble", "ripple", "paper"),
    ],
)
def test_the_robot_walks_on_slowly_while_its_gait_changes(
    placed: LiveRobot, first: str, then: str, control: str
) -> None:
    placed.place(replace(placed.choices.first(), gait=first, control=control))
    fast, own = Drive(forward=1.0, speed=0.8), load_robot("athena")
    gaits = [find_limits(own, make_gait(own, name)) for name in (first, then)]
    for _ in range(500):
        placed.step(placed.limits.command(fast), NO_FORCE)
    placed.change(Change("gait", then))
    slow = placed.limits
    # 0.3 of the smaller limit of both gaits
    assert slow.vx == pytest.approx(0.3 * min(limits.vx for limits in gaits))
    assert (placed.settings.gait, placed.wanted.gait) == (first, then)
    angles, speeds = [value(placed, *ANGLES)], []
    while placed.limits == slow:
        placed.step(placed.limits.command(fast), NO_FORCE)
        angles.append(value(placed, *ANGLES))
        speeds.append(value(placed, "torso.velocity[1]")[0])
    assert (placed.settings.gait, placed.limits, placed.fault) == (then, gaits[1], "")
    # rad    a macro-step of an undisturbed walk at these speeds needs up to 0.05
    assert np.abs(np.diff(angles, axis=0)).max() < 0.05
    # the robot never stops: the mean over a quarter of a second
    means = np.convolve(speeds, np.full(50, 0.02), mode="valid")
    assert means.min() > 0.5 * 0.8 * slow.vx


def test_other_changes_during_a_change_of_gait_are_followed(placed: LiveRobot) -> None:
    slow = BodyCommand(vx=0.02)
    go(placed, 300, slow)
    for change in (
        Change("gait", "wave"),
        Change("gait", "amble"),
        Change("friction", 0.5),
        Change("control", "compliant"),
    ):
        placed.change(change)
        go(placed, 30, slow)
    assert placed.wanted == replace(placed.settings, gait="amble")
    go(placed, 700, slow)
    settings = placed.settings
    assert (settings.gait, settings.friction, settings.control) == ("amble", 0.5, "compliant")
    begin = place_of(placed)[0]
    go(placed, 400)
    assert place_of(placed)[0] > begin + 0.06
    assert placed.fault == ""


def test_another_ground_places_the_robot_on_it(placed: LiveRobot) -> None:
    go(placed, 100)
    placed.change(Change("ground", "random_uniform"))
    assert (placed.count, placed.settings.ground) == (0, "random_uniform")
    go(placed, 100)
    assert placed.fault == ""
    assert np.ptp(
        value(placed, "LF.foot.position[3]", "RF.foot.position[3]", "LM.foot.position[3]")
    )


@pytest.mark.parametrize("key", ["gait", "control", "ground"])
def test_an_unknown_name_is_refused_and_nothing_changes(placed: LiveRobot, key: str) -> None:
    before, settings = placed.signals.values.copy(), placed.settings
    with pytest.raises(HexapodError, match=f"unknown {key}: got 'nothing'"):
        placed.change(Change(key, "nothing"))
    assert placed.settings == settings
    np.testing.assert_array_equal(placed.signals.values, before)


def test_a_recording_with_a_push_and_a_limp_leg_is_the_same_walk(placed: LiveRobot) -> None:
    recording = Recording(placed.plan.scenario)
    turn = placed.limits.command(Drive(forward=0.4, turn=0.6, speed=0.4))
    inputs = [(WALK, NO_FORCE)] * 200 + [(turn, (0.0, 3.0, 1.0))] * 50 + [(STAND, NO_FORCE)] * 50
    for k, (command, force) in enumerate(inputs):
        if k in (100, 130):
            placed.toggle_leg(4)
        recording.note(command, force, placed.limp)
        placed.step(command, force)
    scenario = scenario_from_table(parse_toml(recording.as_toml()), where="driven.toml")
    assert [(one.leg, one.fault) for one in scenario.events_of(ServoFault)] == [("RM", "limp")]
    assert scenario.duration == pytest.approx(300 * 0.005)
    assert len(scenario.commands) == 3
    assert [push.force for push in scenario.events_of(Push)] == [(0.0, 3.0, 1.0)]
    with Runner(everything=True) as runner:
        walked = runner.simulate(scenario).outcome.recording
    # the push is a mean over a macro-step, whose times are rounded
    end = walked.columns(vector_names("torso.position"))[-1]
    np.testing.assert_allclose(end, place_of(placed), rtol=0.0, atol=1e-9)


def test_a_recording_under_compliant_control_on_rubble_repeats_bit_for_bit() -> None:
    # rubble names no gait, so compliant control alone would choose gait and stance
    scenario = load_scenario("rubble", overrides=["control=compliant"])
    designed = chosen_gains(live_scenario(scenario))
    with LiveRobot(Choices(scenario, control_texts(scenario), {}), gains=designed) as robot:
        recording = Recording(robot.plan.scenario)
        turn = robot.limits.command(Drive(forward=0.4, turn=0.6, speed=0.4))
        for command in [WALK] * 150 + [turn] * 100 + [STAND] * 50:
            recording.note(command, NO_FORCE)
            robot.step(command, NO_FORCE)
        names = [*vector_names("torso.position"), *joint_names("angle"), *joint_names("speed")]
        end = value(robot, *names)
    saved = scenario_from_table(parse_toml(recording.as_toml()), where="driven.toml")
    with Runner(everything=True) as runner:
        walked = runner.simulate(saved).outcome.recording
    np.testing.assert_array_equal(walked.columns(names)[-1], end)


FAILS = """
import sys
import numpy as np
from hexapod_cosim.controller import JointCommand


class Fails:
    def __init__(self, robot):
        self.command, self.count = JointCommand(angle_ref=np.array(robot.stance)), 0

    def step(self, t, command, measurement):
        self.count += 1
        if self.count == 20:
            {act}
        return self.command
"""
FAULTS = {
    "angle": ("self.command.angle_ref[4, 1] = 7.0", "RM.femur.angle_ref"),
    "torque": ("self.command.torque_ref[:] = 1e9", "LF.coxa.torque_ref"),
    "exit": ("sys.exit(3)", "line 14, in step: SystemExit: 3; a controller must not end"),
    "exception": ("raise ZeroDivisionError('no legs left')", "ZeroDivisionError: no legs left"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_controller_that_fails_is_replaced_by_joints_that_hold(tmp_path: Path, case: str) -> None:
    act, message = FAULTS[case]
    (tmp_path / "law.py").write_text(FAILS.format(act=act), encoding="utf-8")
    scenario = load_scenario("stand", overrides=[f"control={tmp_path / 'law.py'}:Fails"])
    choices = Choices(scenario, control_texts(scenario, ("kinematic",)), {})
    with LiveRobot(choices) as robot:
        held = go(robot, 19, STAND)[-1]
        assert robot.fault == ""
        angles = go(robot, 50, STAND)
        assert message in robot.fault
        assert (robot.stopped, robot.count) == (False, 69)
        np.testing.assert_array_equal(angles, np.tile(held, (50, 1)))
        # another control places the robot anew, and walks
        robot.change(Change("control", "kinematic"))
        assert (robot.fault, robot.count) == ("", 0)
        go(robot, 400)
        assert place_of(robot)[0] > 0.05


def test_a_controller_that_cannot_begin_is_refused_at_first_and_a_fault_later(
    tmp_path: Path,
) -> None:
    law = tmp_path / "law.py"
    law.write_text("class Never:\n    def __init__(self):\n        raise OSError('no disk')\n")
    scenario = load_scenario("stand")
    texts = control_texts(scenario, ("kinematic",)) | {"Never": f"{law}:Never"}
    with pytest.raises(HexapodError, match="OSError: no disk"):
        LiveRobot(Choices(load_scenario("stand", overrides=[f"control={law}:Never"]), texts, {}))
    with LiveRobot(Choices(scenario, texts, {})) as robot:
        robot.change(Change("control", "Never"))
        go(robot, 20)
        assert "OSError: no disk" in robot.fault
        assert place_of(robot)[2] > 0.1
        robot.change(Change("control", "kinematic"))
        assert (robot.fault, robot.settings.control) == ("", "kinematic")


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
@pytest.mark.parametrize("gait", ["tripod", "wave"])
def test_the_legs_reach_every_command_that_a_drive_can_ask_for(name: str, gait: str) -> None:
    scenario = load_scenario("walk_flat", overrides=[f"robot={name}", f"gait.name={gait}"])
    own = load_robot(name)
    limits = find_limits(own, gait_of(scenario))
    assert min(vars(limits).values()) > 0.0
    signs = (-1.0, 0.0, 1.0)
    commands = [Command(**vars(limits.command(Drive(*axes)))) for axes in product(signs, repeat=4)]
    check_commands(commands, own, gait_of(scenario), where="drive")


def test_a_ground_on_which_the_robot_cannot_start_leaves_it_on_the_one_before(
    placed: LiveRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse_grids(plant: Fmu, plan: RunPlan) -> dict[str, float]:
        if plan.robot.terrain.kind != "flat":
            raise HexapodError("no place to stand")
        return initialise_plant(plant, plan)

    monkeypatch.setattr(live_robot, "initialise_plant", refuse_grids)
    with pytest.raises(HexapodError, match="no place to stand"):
        placed.change(Change("ground", "stairs"))
    assert placed.settings.ground == "scenario"
    go(placed, 300)
    assert placed.fault == ""
    assert place_of(placed)[0] > 0.02
