"""Tests laws of a robot whose torso, knees and shanks touch the ground: rest, energy, symmetry, and
the same bits by all kernels and after a restore.
"""

from __future__ import annotations

import ctypes as ct
from typing import Any

import numpy as np
import pytest
from mirror import LEGS
from plant import Plant
from states import changed

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.bodies import body_contacts
from hexapod_cosim.models.dynamics import Command

MACRO = 0.005  # s
UPTURNED = np.array([0.0, 1.0, 0.0, 0.0])  # turned by half a turn about x
REST = 1e-6  # relative: what is left of the motion after settling
ON = {"contact": "on"}
FOLDED_LEGS = np.tile(
    [0.0, -0.3, 0.2], (LEGS, 1)
)  # rad: knees and feet of an upturned robot are high
KNEELING = np.tile([0.0, -0.5, -0.75], (LEGS, 1))  # rad: the knees are the lowest points


def athena(**sections: dict[str, Any]) -> Robot:
    return changed(load_robot("athena"), **{"body": ON} | sections)


def dropped(core: ct.CDLL, robot: Robot, angle: Array, height: float, **initial: Any) -> Plant:
    """Returns a plant with these joint angles, its torso at a height [m]."""
    return Plant(core, robot, position=(0.0, 0.0, height), angle=angle, **initial)


def settle(plant: Plant, angle: Array, seconds: float) -> Any:
    """Holds the joint angles for a time [s]; returns the output."""
    command = Command(angle_ref=angle)
    for k in range(round(seconds / MACRO)):
        plant.step((k + 1) * MACRO, command)
    return plant.output(command)


def static_depth(robot: Robot, force: Any) -> Array:
    """Returns the depth [m] at which the normal law bears a force [N]."""
    depth: Array = (np.asarray(force) / robot.contact.stiffness) ** (2.0 / 3.0)
    return depth


def test_an_upturned_robot_comes_to_rest_on_the_corners_of_its_torso(core: ct.CDLL) -> None:
    robot = athena()
    plant = dropped(core, robot, FOLDED_LEGS, 0.06, quaternion=UPTURNED)
    output = settle(plant, FOLDED_LEGS, 3.0)
    assert output.torso.contact_force[2] == pytest.approx(54.936, rel=REST)
    assert np.abs(output.torso.contact_force[:2]).max() < 1e-6 * 54.936
    assert output.foot.normal_force.sum() == 0.0
    assert output.body.knee_force.max() == output.body.shank_force.max() == 0.0
    depth = np.array([contact.penetration for contact in body_contacts(robot, plant.bodies)])
    resting = depth[depth > 0.0]
    assert resting == pytest.approx(static_depth(robot, np.full(4, 54.936 / 4.0)), rel=1e-5)
    assert output.torso.position[2] == pytest.approx(0.04 - resting[0], abs=1e-9)


@pytest.mark.parametrize("body", [ON, ON | {"shank_radius": 0.0}], ids=["shanks", "knees alone"])
def test_a_kneeling_robot_rests_on_its_knees(core: ct.CDLL, body: dict[str, Any]) -> None:
    robot = athena(body=body)
    plant = dropped(core, robot, KNEELING, 0.07)
    output = settle(plant, KNEELING, 3.0)
    assert output.body.knee_force[:, 2].sum() == pytest.approx(54.936, rel=REST)
    assert output.body.knee_force[:, 2].min() > 5.0
    assert output.foot.normal_force.sum() == 0.0
    assert np.all(output.torso.contact_force == 0.0)
    depth = np.array([contact.penetration for contact in body_contacts(robot, plant.bodies)])
    allowed = static_depth(robot, output.body.knee_force[:, 2].max())
    assert depth.max() <= allowed * (1.0 + 1e-5)


@pytest.mark.parametrize("angle", [FOLDED_LEGS, KNEELING])
def test_the_energy_books_of_a_drop_close_with_the_tolerance(core: ct.CDLL, angle: Array) -> None:
    """The residual is the error of the integrator, so it falls with the tolerance."""
    start = {"quaternion": UPTURNED} if angle is FOLDED_LEGS else {}
    residual = {}
    for tolerance in (1e-4, 1e-7):
        robot = athena(solver={"tolerance": tolerance})
        output = settle(dropped(core, robot, angle, 0.1, **start), angle, 0.3)
        assert output.energy.dissipated > 0.5
        residual[tolerance] = abs(output.energy.residual) / output.energy.dissipated
    assert residual[1e-4] < 1e-2
    assert residual[1e-7] < 1e-5


def test_every_kernel_gives_the_same_rates_with_the_body_in_the_ground(core: ct.CDLL) -> None:
    plant = dropped(core, athena(), FOLDED_LEGS, 0.039, quaternion=UPTURNED)
    command = Command(angle_ref=FOLDED_LEGS)
    seen = plant.rates_of_kernels(command)
    assert plant.output(command).torso.contact_force[2] > 10.0
    assert all(np.array_equal(rate, seen["baseline"]) for rate in seen.values())
