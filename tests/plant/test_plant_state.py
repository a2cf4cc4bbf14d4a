"""Tests that repeating, restoring and resetting a plant, stepping other plants, and steps that end
at an event change no bit.
"""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from plant import Plant, definition
from states import MACRO, changed, landing, lopsided, random_bodies, trail

from hexapod_cosim.models import METHODS, Robot, load_robot
from hexapod_cosim.models.dynamics import Command


@pytest.mark.parametrize("method", METHODS)
def test_a_rerun_gives_the_same_bits(core: ct.CDLL, method: str) -> None:
    robot = changed(load_robot("athena"), solver={"method": method})
    one, two = (trail(Plant(core, robot, **landing(robot)), 8) for _ in range(2))
    assert one == two
    assert len(set(one)) == len(one)


@pytest.mark.parametrize("mode", ["position", "torque", "kinematic"])
@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_restoring_at_any_point_gives_the_same_bits_in_another_instance(
    core: ct.CDLL, mode: str, law: str
) -> None:
    robot, other = (
        changed(lopsided(), servo={"mode": mode}, friction={"law": law}),
        load_robot("athena"),
    )
    whole = trail(Plant(core, robot, **landing(robot)), 12)
    touching = set()
    for k in (0, 3, 6, 9, 11):
        stranger = Plant(core, other)  # the other instance had another robot and another time
        stranger.step(0.01)
        stranger.restore(whole[k])
        assert stranger.save() == whole[k]
        touching.add(int(np.sum(stranger.output().foot.contact)))
        stranger.robot = robot
        assert trail(stranger, 11 - k, first=k + 1) == whole[k + 1 :]
    assert len(touching) > 1  # in the air as well as in contact


@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_a_reset_goes_back_to_the_exact_start(core: ct.CDLL, law: str) -> None:
    robot = changed(load_robot("athena"), friction={"law": law})
    plant = Plant(core, robot, **landing(robot))
    start = plant.save()
    first = trail(plant, 6)
    plant.reset(definition(robot, **landing(robot)))
    assert plant.save() == start
    assert trail(plant, 6) == first


def test_setting_the_bodies_restarts_the_energy_balance_at_the_same_time(core: ct.CDLL) -> None:
    robot = load_robot("athena")
    plant = Plant(core, robot, **landing(robot))
    trail(plant, 8)
    plant.bodies = random_bodies(robot, 4)
    output = plant.output()
    assert output.time == 8 * MACRO
    assert (
        output.energy.actuator_work,
        output.energy.dissipated,
        output.energy.residual,
        output.solver.steps,
    ) == (0.0, 0.0, 0.0, 0.0)
    assert np.array_equal(output.foot.contact != 0, output.foot.penetration > 0.0)


def test_a_start_time_shifts_the_time_and_nothing_else(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), solver={"step": 2.0**-10})
    early, late = Plant(core, robot, **landing(robot)), Plant(core, robot)
    late.reset(definition(robot, **landing(robot)), 64.0)
    early.step(2.0**-5)
    late.step(64.0 + 2.0**-5)
    assert late.time == 64.0 + 2.0**-5
    assert (
        float(np.max(np.abs(early.bodies - late.bodies))) < 1e-9
    )  # touch-down is found to 1e-10 m


# Tests steps that end at touch-down or lift-off: continuing gives the same bits as one call.

END = 0.15  # s, in which a robot dropped from DROP touches down, bounces and touches down again
DROP = 0.15  # m, height of the drop
ATHENA = load_robot("athena")


def dropped(core: ct.CDLL, robot: Robot) -> Plant:
    return Plant(core, robot, position=[0.0, 0.0, DROP])


def command_of(robot: Robot) -> Command:
    """Returns a command that moves the joints, so that kinematic drives depend on the command's
    time.
    """
    return Command(angle_ref=robot.stance, speed_ref=np.full((6, 3), 0.2))


@pytest.mark.parametrize("method", ["rosw3", "ros2", "dp54"])
@pytest.mark.parametrize("step", [0.0, 2e-4])
@pytest.mark.parametrize("mode", ["position", "kinematic"])
@pytest.mark.parametrize("friction", ["tanh", "bristle"])
def test_stops_at_events_leave_no_trace(
    core: ct.CDLL, method: str, step: float, mode: str, friction: str
) -> None:
    robot = changed(
        ATHENA,
        servo={"mode": mode},
        solver={"method": method, "step": step},
        friction={"law": friction},
    )
    command, whole, broken = command_of(robot), dropped(core, robot), dropped(core, robot)
    whole.step(END, command)
    stops = 0
    while broken.time < END:
        stops += broken.step_to_event(END, command)
    assert stops >= 2
    assert broken.save() == whole.save()


def test_a_saved_state_goes_on_as_the_call_that_was_broken_off(core: ct.CDLL) -> None:
    command, whole, broken = command_of(ATHENA), dropped(core, ATHENA), dropped(core, ATHENA)
    whole.step(END, command)
    assert broken.step_to_event(END, command)
    other = dropped(core, ATHENA)
    other.restore(broken.save())
    other.step(END, command)
    assert other.save() == whole.save()


def test_another_input_after_a_stop_is_a_call_of_its_own(core: ct.CDLL) -> None:
    robot = changed(ATHENA, servo={"mode": "kinematic"})
    command, plant = command_of(robot), dropped(core, robot)
    assert plant.step_to_event(END, command)
    other = dropped(core, robot)
    other.restore(plant.save())
    turned = Command(angle_ref=command.angle_ref, speed_ref=-command.speed_ref)
    other.step(END, turned)
    plant.step(END, command)
    early, late = plant.output(command).angle, other.output(turned).angle
    assert (early > late).all()
