"""Tests steps that end at touch-down or lift-off: continuing gives the same bits as one call."""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from plant import Plant
from states import changed

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.dynamics import Command

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
