"""Joint stops (eq. 39): a link that strikes its stop has closed forms; stops and books."""

from __future__ import annotations

import ctypes as ct
import math
from typing import Any

import numpy as np
import pytest
from plant import Plant, probed
from states import changed, with_links
from test_laws_servo import CLOSED, tibia_inertia, tibias, walled

from hexapod_cosim.models import Robot
from hexapod_cosim.models.actuator import overrun, stop_energy, stop_slopes, stop_torque
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.records import Array

SAME = 1e-13  # relative: the same formula
SPEED = 2.0  # rad/s  of a tibia that strikes its stop


def struck(**servo: Any) -> Robot:
    """Returns a walled robot without motors whose tibias have stops at -0.5 and 0.1 rad."""
    robot = walled(mode="torque", **({"stop_stiffness": 200.0} | servo))
    return with_links(robot, 2, angle_min=-0.5, angle_max=0.1)


def free() -> Command:
    return Command(angle_ref=np.zeros((6, 3)))


def knee(plant: Plant) -> tuple[Array, Array]:
    """Returns angles and speeds (6,) of the knees."""
    output = plant.output(free())
    return np.array(output.angle)[:, 2], np.array(output.speed)[:, 2]


# the law


@pytest.mark.parametrize("damping", [0.0, 0.5, 50.0])
def test_the_plants_stops_are_the_twins(core: ct.CDLL, damping: float) -> None:
    robot = struck(stop_damping=damping)
    plant, rng = Plant(core, robot), np.random.default_rng(1)
    seen = set()
    for angle, speed in zip(rng.uniform(-0.9, 0.5, 100), rng.normal(0.0, 5.0, 100), strict=True):
        past = overrun(np.array([angle]), np.array([-0.5]), np.array([0.1]))
        got = probed(core.hx_probe_stop, plant, 4, 2, float(angle), float(speed), size=4)
        torque = float(stop_torque(robot.servo, past, np.array([speed]))[0])
        slopes = [float(part[0]) for part in stop_slopes(robot.servo, past, np.array([speed]))]
        assert [got[0], *got[2:]] == pytest.approx([torque, *slopes], rel=SAME, abs=SAME)
        assert got[1] == pytest.approx(-torque - 200.0 * float(past[0]), abs=1e-12)
        seen.add((bool(past[0] != 0.0), slopes[1] != 0.0))
    assert (False, False) in seen


def test_a_stop_neither_pulls_nor_jumps() -> None:
    servo = struck(stop_damping=3.0).servo
    for speed in (-10.0, -1.0, 0.0, 1.0, 10.0):
        for past in (1e-9, 1e-3, 0.2):
            torque = float(stop_torque(servo, np.array(past), np.array(speed)))
            assert -2.0 * 200.0 * past <= torque <= 0.0
            mirrored = float(stop_torque(servo, np.array(-past), np.array(-speed)))
            assert mirrored == -torque


def test_a_stop_is_found_on_the_near_side_past_a_half_turn() -> None:
    """3.2 rad is 0.1 rad past a stop at 3.1 rad, not half a turn short of one at -1 rad."""
    low, high = np.array(-1.0), np.array(3.1)
    wrapped = np.array(3.2 - 2.0 * math.pi)
    assert float(overrun(wrapped, low, high)) == pytest.approx(0.1, abs=1e-12)
    assert float(overrun(np.array(3.0), low, high)) == 0.0


# a tibia that strikes its stop


def test_a_link_strikes_an_undamped_stop_and_returns_as_fast(core: ct.CDLL) -> None:
    """Half a period pi sqrt(I/k) in it, to w sqrt(I/k) deep; all its energy is the stop's there."""
    robot = struck()
    plant = Plant(core, robot, angle=tibias(0.1 - 0.2), speed=tibias(SPEED))
    time = math.sqrt(tibia_inertia(robot) / 200.0)
    plant.step(0.1 + 0.5 * math.pi * time, free())
    angle, speed = knee(plant)
    assert angle == pytest.approx(np.full(6, 0.1 + SPEED * time), rel=CLOSED)
    assert float(np.max(np.abs(speed))) < CLOSED * SPEED
    stored = 6.0 * 0.5 * tibia_inertia(robot) * SPEED**2
    past = np.full(6, SPEED * time)
    assert float(np.sum(stop_energy(robot.servo, past))) == pytest.approx(stored, rel=CLOSED)
    assert plant.output(free()).energy.potential == pytest.approx(stored, rel=CLOSED)
    plant.step(0.1 + math.pi * time + 0.05, free())
    angle, speed = knee(plant)
    assert speed == pytest.approx(np.full(6, -SPEED), rel=CLOSED)
    assert angle == pytest.approx(np.full(6, 0.1 - 0.05 * SPEED), abs=CLOSED)


@pytest.mark.parametrize("method", ["rosw3", "dp54"])
def test_what_a_damped_stop_takes_is_the_gear_loss_and_no_work_of_motors(
    core: ct.CDLL, method: str
) -> None:
    robot = changed(struck(stop_damping=0.5), solver={"method": method, "tolerance": 1e-9})
    plant = Plant(core, robot, angle=tibias(0.0), speed=tibias(SPEED))
    plant.step(0.3, free())
    _, speed = knee(plant)
    assert np.all(speed < -0.1)
    assert np.all(speed > -0.95 * SPEED)
    lost = 0.5 * tibia_inertia(robot) * float(np.sum(SPEED**2 - speed**2))
    energy = plant.output(free()).energy
    assert energy.gear_loss == pytest.approx(lost, rel=1e-5)
    assert energy.dissipated == pytest.approx(lost, rel=1e-5)
    assert energy.actuator_work == 0.0
    assert abs(energy.residual) < 1e-6 * lost


def test_a_servo_that_pushes_into_a_stop_rests_where_both_torques_agree(core: ct.CDLL) -> None:
    """tau/k = 1.5/200 rad past the stop."""
    robot = struck(stop_damping=2.0, torque_max=100.0, speed_max=1e6)
    plant = Plant(core, robot, angle=tibias(0.0))
    push = Command(angle_ref=np.zeros((6, 3)), torque_ref=tibias(1.5))
    plant.step(3.0, push)
    angle = np.array(plant.output(push).angle)[:, 2]
    assert angle == pytest.approx(np.full(6, 0.1 + 1.5 / 200.0), abs=1e-7)


# with the whole robot
