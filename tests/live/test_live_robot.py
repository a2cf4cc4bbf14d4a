"""A robot that is stepped and changed while it walks, without a clock and without a page."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from gains import make_gains
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, make_gait
from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.run.preparation import chosen_gains
from hexapod_cosim.cosim.run.single_run import RunPlan, initialise_plant
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.reach import check_commands
from hexapod_cosim.cosim.scenario.records import Command
from hexapod_cosim.cosim.scenario.scenario import (
    load_scenario,
    scenario_from_table,
)
from hexapod_cosim.extensions.live import robot as live_robot
from hexapod_cosim.extensions.live.protocol import Change, Drive
from hexapod_cosim.extensions.live.robot import LiveRobot
from hexapod_cosim.extensions.live.settings import (
    Choices,
    control_texts,
    find_limits,
    gait_of,
    live_scenario,
)
from hexapod_cosim.extensions.live.take import NO_FORCE, Take
from hexapod_cosim.models import HexapodError, load_robot
from hexapod_cosim.models.schema import parse_toml

WALK = BodyCommand(vx=0.08)
FAILING = """
from hexapod_cosim.controller import JointCommand
import numpy as np


class Fails:
    def __init__(self, robot, period):
        self.stance, self.last = np.array(robot.stance), int(0.2 / period)
        self.count = 0

    def step(self, t, command, measurement):
        self.count += 1
        if self.count > self.last:
            raise ZeroDivisionError("no legs left")
        return self.stance
"""


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


def go(robot: LiveRobot, steps: int, command: BodyCommand = WALK) -> None:
    for _ in range(steps):
        robot.step(command, NO_FORCE)


def go_on(robot: LiveRobot, command: BodyCommand = WALK) -> int:
    """Walks until a change has been made; returns the macro-steps."""
    for count in range(2000):
        if robot.wanted is None:
            return count
        robot.step(command, NO_FORCE)
    pytest.fail("the change was never made")


def test_a_live_walk_is_the_walk_of_simulate_bit_for_bit(placed: LiveRobot) -> None:
    scenario = load_scenario("walk_flat", overrides=["duration=1.0"])
    with Walker(everything=True) as walker:
        recording = walker.simulate(scenario).outcome.recording
    for row in range(200):
        present = value(placed, *recording.names[1:10])
        np.testing.assert_array_equal(present, recording.data[row, 1:10])
        placed.step(WALK, NO_FORCE)


def test_friction_changes_while_the_robot_walks_and_its_motion_goes_on(placed: LiveRobot) -> None:
    go(placed, 300)
    names = [*joint_names("angle"), *joint_names("speed"), *vector_names("torso.velocity")]
    before, time = value(placed, *names), placed.time
    placed.change(Change("friction", 0.3))
    np.testing.assert_allclose(value(placed, *names), before, rtol=0.0, atol=1e-9)
    assert placed.time == time
    assert placed.settings.friction == 0.3
    assert placed.parameters["friction.mu"] == 0.7  # of the start
    begin = place_of(placed)[0]
    go(placed, 300)
    assert place_of(placed)[0] - begin == pytest.approx(0.12, rel=0.1)
    assert placed.fault == ""


@pytest.mark.parametrize(("friction", "slides"), [(0.7, False), (0.1, True)])
def test_a_standing_robot_slides_when_the_push_exceeds_the_friction(
    placed: LiveRobot, friction: float, slides: bool
) -> None:
    placed.change(Change("friction", friction))
    for _ in range(40):
        placed.step(BodyCommand(), (0.0, 0.3 * placed.weight, 0.0))
    feet = value(placed, *(f"{leg}.foot.slip_speed" for leg in ("LM", "RM")))
    # (0.3 - 0.1) g for 0.2 s is 0.39 m/s; the friction of 0.7 holds all feet
    assert np.all((feet > 0.3) if slides else (feet < 0.01))


@pytest.mark.parametrize(
    "change", [Change("gait", "ripple"), Change("control", "compliant"), Change("control", "paper")]
)
def test_gait_and_control_change_while_the_robot_walks_without_a_jump_of_the_joints(
    placed: LiveRobot, change: Change
) -> None:
    go(placed, 300)
    placed.change(change)
    largest, angles = 0.0, value(placed, *joint_names("angle_ref"))
    for _ in range(2000):
        placed.step(WALK, NO_FORCE)
        now = value(placed, *joint_names("angle_ref"))
        largest, angles = max(largest, float(np.abs(now - angles).max())), now
        if placed.wanted is None and placed.settings == placed.choices.changed(
            placed.choices.first(), change
        ):
            break
    begin = place_of(placed)[0]
    for _ in range(600):
        placed.step(WALK, NO_FORCE)
        now = value(placed, *joint_names("angle_ref"))
        largest, angles = max(largest, float(np.abs(now - angles).max())), now
    assert getattr(placed.settings, change.key) == change.value
    assert place_of(placed)[0] > begin + 0.1  # it walks on by itself
    # rad    the swings of these gaits need up to 0.05 rad in a macro-step; a jump would be larger
    assert largest < 0.1
    assert placed.fault == ""


@pytest.mark.parametrize("gait", ["tripod", "amble"])
@pytest.mark.parametrize(
    ("first", "then"), list(permutations(("kinematic", "compliant", "paper"), 2))
)
def test_the_control_changes_while_the_robot_walks_in_any_phase(
    placed: LiveRobot, first: str, then: str, gait: str
) -> None:
    for phase in (0.1, 0.35, 0.6, 0.85):
        placed.place(replace(placed.choices.first(), gait=gait, control=first))
        period = {"tripod": 0.75, "amble": 1.125}[gait]
        command = replace(WALK, vx=0.6 * placed.limits.vx)
        go(placed, round((2.0 + phase) * period / 0.005), command)
        angles, speeds = [value(placed, *joint_names("angle_ref"))], []
        heights, begin = [], place_of(placed)[0]
        placed.change(Change("control", then))
        assert (placed.settings.control, placed.wanted) == (then, None)
        for _ in range(400):
            placed.step(command, NO_FORCE)
            angles.append(value(placed, *joint_names("angle_ref")))
            speeds.append(value(placed, "torso.velocity[1]")[0])
            heights.append(place_of(placed)[2])
        # rad    in a macro-step: walks at these speeds need up to 0.023, compliant control adds up
        # to 0.004 when it lifts a foot that meets the ground early, and the paper's up to 0.018
        # when a foot takes up its load
        paper = "paper" in (first, then)
        assert np.abs(np.diff(angles, axis=0)).max() < (0.042 if paper else 0.03)
        # m    it neither falls nor stops: means over a quarter of a second
        assert min(heights) > 0.12
        assert np.convolve(speeds, np.full(50, 0.02), mode="valid").min() > 0.5 * command.vx
        # the paper's control does not hold the path, and walks some 5 % further than commanded
        rel = 0.08 if paper else 0.05
        assert place_of(placed)[0] - begin == pytest.approx(2.0 * command.vx, rel=rel)
        assert placed.fault == ""


@pytest.mark.parametrize("then", ["kinematic", "paper"])
def test_a_standing_robot_changes_its_control_at_once_and_then_walks(
    placed: LiveRobot, then: str
) -> None:
    placed.place(replace(placed.choices.first(), control="compliant"))
    go(placed, 100, BodyCommand())
    height = place_of(placed)[2]
    placed.change(Change("control", then))
    assert placed.settings.control == then
    go(placed, 200, BodyCommand())
    # m    kinematic control lets the servos sag by 2 mm, the paper's control yields by 4 mm more
    assert place_of(placed)[2] == pytest.approx(height, abs=0.008)
    go(placed, 400)
    assert place_of(placed)[0] > 0.08


@pytest.mark.parametrize(
    ("first", "then", "control"),
    [
        ("tripod", "wave", "compliant"),
        ("wave", "tripod", "kinematic"),
        ("amble", "ripple", "compliant"),
        ("ripple", "amble", "paper"),
    ],
)
def test_the_robot_walks_on_while_its_gait_changes(
    placed: LiveRobot, first: str, then: str, control: str
) -> None:
    placed.place(replace(placed.choices.first(), gait=first, control=control))
    fast = Drive(forward=1.0, speed=0.8)
    for _ in range(700):
        placed.step(placed.limits.command(fast), NO_FORCE)
    before = placed.limits
    placed.change(Change("gait", then))
    slow = placed.limits
    # 0.3 of the smaller limit of both gaits
    robot = load_robot("athena")
    gaits = [find_limits(robot, make_gait(robot, name)) for name in (first, then)]
    assert slow.vx == pytest.approx(0.3 * min(limits.vx for limits in gaits))
    angles, speeds = [value(placed, *joint_names("angle_ref"))], []
    while placed.limits == slow:
        placed.step(placed.limits.command(fast), NO_FORCE)
        angles.append(value(placed, *joint_names("angle_ref")))
        speeds.append(value(placed, "torso.velocity[1]")[0])
    assert (placed.settings.gait, placed.wanted, placed.fault) == (then, None, "")
    assert before != placed.limits == gaits[1]
    # rad    a macro-step of an undisturbed walk at these speeds needs up to 0.05
    assert np.abs(np.diff(angles, axis=0)).max() < 0.05
    # the robot never stops: the mean over a quarter of a second
    means = np.convolve(speeds, np.full(50, 0.02), mode="valid")
    assert means.min() > 0.5 * 0.8 * slow.vx


def test_a_slow_walk_changes_its_gait_at_once(placed: LiveRobot) -> None:
    slow = BodyCommand(vx=0.02)
    go(placed, 300, slow)
    placed.change(Change("gait", "ripple"))
    # the legs finish their swings of half a second
    assert go_on(placed, slow) == 101
    assert placed.settings.gait == "ripple"


def test_another_wish_during_a_change_of_gait_is_followed(placed: LiveRobot) -> None:
    slow = BodyCommand(vx=0.02)
    go(placed, 300, slow)
    for gait in ("wave", "amble"):
        placed.change(Change("gait", gait))
        go(placed, 30, slow)
    placed.change(Change("friction", 0.5))
    go_on(placed, slow)
    assert (placed.settings.gait, placed.settings.friction) == ("amble", 0.5)
    placed.change(Change("gait", "ripple"))
    go(placed, 30, slow)
    placed.change(Change("control", "compliant"))
    go_on(placed, slow)
    assert (placed.settings.gait, placed.settings.control) == ("ripple", "compliant")
    assert placed.settings.friction == 0.5
    begin = place_of(placed)[0]
    go(placed, 600)
    assert place_of(placed)[0] > begin + 0.1
    assert placed.fault == ""


def test_two_changes_at_once_are_made_together(placed: LiveRobot) -> None:
    go(placed, 100)
    placed.change(Change("gait", "wave"))
    placed.change(Change("control", "compliant"))
    placed.change(Change("friction", 0.5))
    go_on(placed)
    settings = placed.settings
    assert (settings.gait, settings.control, settings.friction) == ("wave", "compliant", 0.5)


def test_another_ground_places_the_robot_on_it(placed: LiveRobot) -> None:
    go(placed, 300)
    placed.change(Change("ground", "random_uniform"))
    assert placed.count == 0
    assert placed.settings.ground == "random_uniform"
    go(placed, 300)
    assert placed.fault == ""
    assert np.ptp(
        value(placed, "LF.foot.position[3]", "RF.foot.position[3]", "LM.foot.position[3]")
    )


def test_an_unknown_name_is_refused_and_nothing_changes(placed: LiveRobot) -> None:
    go(placed, 50)
    before, settings = placed.signals.values.copy(), placed.settings
    for key in ("gait", "control", "ground"):
        with pytest.raises(HexapodError, match=f"unknown {key}: got 'nothing'"):
            placed.change(Change(key, "nothing"))
    assert placed.settings == settings
    np.testing.assert_array_equal(placed.signals.values, before)


def test_a_push_moves_the_robot_to_its_side(placed: LiveRobot) -> None:
    # an eighth of the weight for half a second, against stiff servos
    for _ in range(100):
        placed.step(BodyCommand(), (0.0, 0.125 * placed.weight, 0.0))
    assert place_of(placed)[1] > 1e-4
    assert value(placed, "torso.push_force[2]") == pytest.approx(0.125 * placed.weight)


def test_a_take_saved_as_a_scenario_is_the_same_walk(placed: LiveRobot) -> None:
    take = Take(placed.plan.scenario)
    turn = placed.limits.command(Drive(forward=0.4, turn=0.6, speed=0.4))
    inputs = [(WALK, NO_FORCE)] * 200 + [(turn, NO_FORCE)] * 150 + [(turn, (0.0, 3.0, 1.0))] * 50
    inputs += [(BodyCommand(), NO_FORCE)] * 50
    for command, force in inputs:
        take.note(command, force)
        placed.step(command, force)
    scenario = scenario_from_table(parse_toml(take.as_toml()), where="driven.toml")
    assert scenario.duration == pytest.approx(450 * 0.005)
    assert len(scenario.commands) == 3
    assert [push.force for push in scenario.pushes] == [(0.0, 3.0, 1.0)]
    assert [take.input(k) for k in (0, 199, 200, 350, 449)] == [
        inputs[k] for k in (0, 199, 200, 350, 449)
    ]
    with Walker(everything=True) as walker:
        recording = walker.simulate(scenario).outcome.recording
    # the push is a mean over a macro-step, whose times are rounded
    end = recording.columns(vector_names("torso.position"))[-1]
    np.testing.assert_allclose(end, place_of(placed), rtol=0.0, atol=1e-9)


def test_a_take_under_compliant_control_on_rubble_repeats_bit_for_bit() -> None:
    # rubble names no gait, so compliant control alone would choose gait and stance
    scenario = load_scenario("rubble", overrides=["control=compliant"])
    designed = chosen_gains(live_scenario(scenario))
    with LiveRobot(Choices(scenario, control_texts(scenario), {}), gains=designed) as robot:
        take = Take(robot.plan.scenario)
        turn = robot.limits.command(Drive(forward=0.4, turn=0.6, speed=0.4))
        for command in [WALK] * 200 + [turn] * 200 + [BodyCommand()] * 50:
            take.note(command, NO_FORCE)
            robot.step(command, NO_FORCE)
        names = [*vector_names("torso.position"), *joint_names("angle"), *joint_names("speed")]
        end, settings = value(robot, *names), robot.settings
    assert (settings.control, settings.gait) == ("compliant", "tripod")
    saved = scenario_from_table(parse_toml(take.as_toml()), where="driven.toml")
    with Walker(everything=True) as walker:
        recording = walker.simulate(saved).outcome.recording
    np.testing.assert_array_equal(recording.columns(names)[-1], end)


def test_a_controller_that_raises_is_replaced_by_joints_that_hold(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(FAILING, encoding="utf-8")
    scenario = load_scenario("stand", overrides=[f"control={tmp_path / 'law.py'}:Fails"])
    choices = Choices(scenario, control_texts(scenario, ("kinematic",)), {})
    with LiveRobot(choices) as robot:
        go(robot, 100, BodyCommand())
        assert "ZeroDivisionError: no legs left" in robot.fault
        assert "law.py, line 14" in robot.fault
        assert not robot.stopped
        held = value(robot, *joint_names("angle_ref"))
        height = place_of(robot)[2]
        go(robot, 100, BodyCommand())
        np.testing.assert_array_equal(value(robot, *joint_names("angle_ref")), held)
        assert place_of(robot)[2] == pytest.approx(height, abs=1e-4)
        # another control takes over at once, and walks
        robot.change(Change("control", "kinematic"))
        go(robot, 500)
        assert robot.fault == ""
        assert place_of(robot)[0] > 0.05
        # and the first one fails again in the same way
        robot.change(Change("control", "Fails"))
        go_on(robot)
        go(robot, 200, BodyCommand())
        assert "no legs left" in robot.fault


REFUSED = """
import sys
import numpy as np
from hexapod_cosim.controller import JointCommand


class Refused:
    def __init__(self, robot):
        self.command, self.count = JointCommand(angle_ref=np.array(robot.stance)), 0

    def step(self, t, command, measurement):
        self.count += 1
        if self.count == 20:
            {act}
        return self.command
"""
REFUSALS = {
    "angle": ("self.command.angle_ref[4, 1] = 7.0", "RM.femur.angle_ref"),
    "torque": ("self.command.torque_ref[:] = 1e9", "LF.coxa.torque_ref"),
    "exit": ("sys.exit(3)", "line 14, in step: SystemExit: 3; a controller must not end"),
    "interrupt": ("raise KeyboardInterrupt", "line 14, in step: KeyboardInterrupt; a controller"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_a_controller_that_commands_nonsense_or_ends_the_program_is_replaced_by_joints_that_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    act, told = REFUSALS[case]
    monkeypatch.setattr(signal, "getsignal", lambda number: signal.SIG_IGN)  # as in its process
    (tmp_path / "law.py").write_text(REFUSED.format(act=act), encoding="utf-8")
    scenario = load_scenario("stand", overrides=[f"control={tmp_path / 'law.py'}:Refused"])
    choices = Choices(scenario, control_texts(scenario, ("kinematic",)), {})
    with LiveRobot(choices) as robot:
        go(robot, 19, BodyCommand())
        assert robot.fault == ""
        held = value(robot, *joint_names("angle_ref"))
        go(robot, 100, BodyCommand())
        assert told in robot.fault
        assert (robot.stopped, robot.count) == (False, 119)
        np.testing.assert_array_equal(value(robot, *joint_names("angle_ref")), held)
        np.testing.assert_array_equal(value(robot, *joint_names("torque_ref")), np.zeros(18))
        robot.change(Change("control", "kinematic"))
        go(robot, 500)
        assert robot.fault == ""
        assert place_of(robot)[0] > 0.05


def test_an_interrupt_of_the_user_is_no_fault_of_the_controller(tmp_path: Path) -> None:
    act = REFUSALS["interrupt"][0]
    (tmp_path / "law.py").write_text(REFUSED.format(act=act), encoding="utf-8")
    scenario = load_scenario("stand", overrides=[f"control={tmp_path / 'law.py'}:Refused"])
    with LiveRobot(Choices(scenario, control_texts(scenario, ()), {})) as robot:
        go(robot, 19, BodyCommand())
        with pytest.raises(KeyboardInterrupt):
            go(robot, 1, BodyCommand())


LEANING = """
import numpy as np


class Leans:
    def __init__(self, robot, period):
        self.pose, self.left = np.array(robot.stance), {steps}
        self.pose[:, 1] += 0.3

    def step(self, t, command, measurement):
        self.left -= 1
        if self.left < 0:
            raise ZeroDivisionError("no legs left")
        return self.pose
"""


@pytest.mark.parametrize("fails", [False, True], ids=["another change", "a fault"])
def test_what_happens_while_the_commands_fade_over_makes_no_jump(
    tmp_path: Path, fails: bool
) -> None:
    steps = 40 if fails else 10_000  # the fade takes 80
    (tmp_path / "law.py").write_text(LEANING.format(steps=steps), encoding="utf-8")
    scenario = load_scenario("stand")
    texts = control_texts(scenario, ("kinematic",)) | {"Leans": f"{tmp_path / 'law.py'}:Leans"}
    with LiveRobot(Choices(scenario, texts, {})) as robot:
        go(robot, 10, BodyCommand())
        robot.change(Change("control", "Leans"))
        go_on(robot, BodyCommand())
        commanded = [value(robot, *joint_names("angle_ref"))]
        for step in range(400):
            if step == 40 and not fails:
                robot.change(Change("control", "kinematic"))
            robot.step(BodyCommand(), NO_FORCE)
            commanded.append(value(robot, *joint_names("angle_ref")))
        assert ("no legs left" in robot.fault) == fails
    moved = np.abs(np.array(commanded) - commanded[0]).max(axis=0).max()
    largest = np.abs(np.diff(commanded, axis=0)).max()
    assert moved > 0.1
    # rad    a cubic of 0.3 rad in 80 steps has 0.3 * 1.5 / 80 = 0.0056 in its steepest one
    assert largest < 0.006


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
        go_on(robot)
        for _ in range(2):
            assert "OSError: no disk" in robot.fault
            go(robot, 20)
            assert place_of(robot)[2] > 0.1
            robot.place()
        robot.change(Change("control", "kinematic"))
        go(robot, 400)
        assert (robot.fault, robot.settings.control) == ("", "kinematic")
        assert place_of(robot)[0] > 0.02


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
@pytest.mark.parametrize("gait", ["tripod", "wave"])
def test_the_legs_reach_every_command_that_a_drive_can_ask_for(name: str, gait: str) -> None:
    scenario = load_scenario("walk_flat", overrides=[f"robot={name}", f"gait.name={gait}"])
    plan = Choices(scenario, control_texts(scenario), {})
    settings = plan.first()
    assert settings.gait == gait
    own = load_robot(name)
    limits = find_limits(own, gait_of(scenario))
    signs = (-1.0, 0.0, 1.0)
    for forward in signs:
        for left in signs:
            for turn in signs:
                for height in (-1.0, -0.5, 0.0, 0.5, 1.0):
                    command = limits.command(Drive(forward, left, turn, height))
                    wanted = Command(**vars(command))
                    check_commands([wanted], own, gait_of(scenario), where="drive")
    assert min(vars(limits).values()) > 0.0


def test_a_ground_on_which_the_robot_cannot_start_leaves_it_on_the_one_before(
    placed: LiveRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = initialise_plant

    def refuse_grids(plant: Fmu, plan: RunPlan) -> dict[str, float]:
        if plan.robot.terrain.kind != "flat":
            raise HexapodError("no place to stand")
        return start(plant, plan)

    monkeypatch.setattr(live_robot, "initialise_plant", refuse_grids)
    go(placed, 50)
    with pytest.raises(HexapodError, match="no place to stand"):
        placed.change(Change("ground", "stairs"))
    assert placed.settings.ground == "scenario"
    go(placed, 300)
    assert placed.fault == ""
    assert place_of(placed)[0] > 0.02
