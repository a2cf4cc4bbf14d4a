"""Tests the plant in the coordinates that importers' solvers use, and its exact derivatives."""

from __future__ import annotations

import ctypes as ct
import itertools
from typing import Any

import numpy as np
import pytest
from mirror import HxCoordinates, HxInput, HxOutput
from plant import Plant, flat, inputs
from states import changed, lopsided, random_command, random_pose

from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.kinematics import body_states

SIZE, INPUTS = ct.sizeof(HxCoordinates) // 8, ct.sizeof(HxInput) // 8
CONTACT = slice(
    HxOutput.foot.offset // 8 + HxOutput.foot.size // 8 - 3,
    HxOutput.foot.offset // 8 + HxOutput.foot.size // 8,
)
ANGLE, SPEED = slice(13, 31), slice(31, 49)
ROUNDING = 1e-12  # relative: rounding of sums of some hundred products

# derivatives at nodes -4 .. 4 of the polynomial through them, which are central differences of
# order 8; their error at this step is rounding, about 1e-12 of the largest derivative of its kind
STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
STEP = 1e-3
DIFFERENCE = 1e-10  # relative to the largest derivative of its kind

VARIANTS: tuple[dict[str, dict[str, Any]], ...] = (
    {"servo": {"kp": 30.0}},
    {"friction": {"law": "bristle"}},
    {"friction": {"law": "none"}, "contact": {"law": "hertz"}},
    {"servo": {"mode": "kinematic"}},
    {"servo": {"mode": "torque"}, "terrain": {"kind": "slope", "incline": 0.2, "heading": 0.7}},
    {"friction": {"mu_static": 1.1, "viscous": 0.3, "stribeck_speed": 0.3, "spin_radius": 0.01}},
    {
        "friction": {"law": "lugre", "stribeck_speed": 0.3, "rolling_radius": 0.01},
        "servo": {"stop_stiffness": 50.0, "stop_damping": 0.1},
    },
)


def smooth(robot: Robot) -> Robot:
    """Returns a robot whose forces are smooth near the state of the test.

    Its servos stay below their limits, and its contacts stay closed.
    """
    gentle = changed(robot, servo={"torque_max": 1e4, "speed_max": 1e4})
    return (
        gentle
        if gentle.contact.law == "hertz"
        else changed(gentle, contact={"law": "constant_damping", "damping_factor": 0.2})
    )


def moving(core: ct.CDLL, robot: Robot, seed: int) -> tuple[Plant, Command]:
    """Returns a plant that moves, with feet in the ground, deflected bristles and a command."""
    plant, command = Plant(core, robot, **random_pose(robot, seed)), random_command(robot, seed)
    plant.step(0.002, command)
    return plant, command


def changed_input(command: Command, change: Array) -> Any:
    return HxInput.from_buffer_copy((flat(inputs(command)) + change).tobytes())


def observed(plant: Plant, given: Any, x: Array) -> tuple[Array, Array]:
    """Returns rates and outputs (the bytes as doubles) at the coordinates x under an HxInput."""
    plant.coordinates = x
    rate, output = HxCoordinates(), HxOutput()
    plant.core.hx_plant_rates(plant.handle, given, rate)
    plant.core.hx_plant_output(plant.handle, given, output)
    return flat(rate), np.delete(np.frombuffer(bytes(output)), np.r_[CONTACT])


def test_coordinates_are_bodies_on_their_joints(core: ct.CDLL) -> None:
    robot = lopsided()
    pose = random_pose(robot, 1)
    pose["quaternion"] /= np.linalg.norm(pose["quaternion"])
    plant = Plant(core, robot)
    plant.coordinates = np.concatenate(
        [
            *(
                np.ravel(pose[name])
                for name in (
                    "position",
                    "quaternion",
                    "velocity",
                    "angular_velocity",
                    "angle",
                    "speed",
                )
            ),
            np.zeros(21),
        ]
    )
    expected = body_states(robot, **pose)
    flipped = np.sign(np.sum(plant.bodies[:, 3:7] * expected[:, 3:7], axis=1))
    expected[:, 3:7] *= flipped[:, None]
    np.testing.assert_allclose(plant.bodies, expected, atol=ROUNDING)


def test_coordinates_come_back(core: ct.CDLL) -> None:
    plant, _ = moving(core, changed(lopsided(), friction={"law": "bristle"}), 2)
    x = plant.coordinates
    plant.coordinates = x
    np.testing.assert_allclose(plant.coordinates, x, atol=ROUNDING)


def test_rates_are_those_of_the_bodies(core: ct.CDLL) -> None:
    plant, command = moving(core, lopsided(), 3)
    plant.coordinates = plant.coordinates
    x, dx, dv, body = (
        plant.coordinates,
        plant.rates(command),
        plant.accelerations(command).dv,
        plant.bodies,
    )
    np.testing.assert_allclose(dx[:3], x[7:10], atol=ROUNDING)
    np.testing.assert_allclose(dx[7:13], dv[0], atol=ROUNDING * np.abs(dv).max())
    np.testing.assert_allclose(dx[ANGLE], x[SPEED], atol=ROUNDING)
    links = np.linalg.norm(
        np.diff(body[1:4, 10:13], axis=0), axis=1
    )  # the speeds of leg LF's joints, whose sign the plant's axes may reverse
    np.testing.assert_allclose(np.abs(x[SPEED][1:3]), links, atol=ROUNDING * 10)


@pytest.mark.parametrize(("variant", "seed"), list(itertools.product(range(len(VARIANTS)), (4, 5))))
def test_derivatives_are_those_of_rates_and_outputs(core: ct.CDLL, variant: int, seed: int) -> None:
    plant, command = moving(core, smooth(changed(lopsided(seed), **VARIANTS[variant])), seed)
    rng, x = np.random.default_rng(seed), plant.coordinates
    direction, pushed = rng.normal(0.0, 0.01, SIZE), rng.normal(0.0, 1.0, INPUTS)
    direction[:3] *= 1e-2
    direction[49:] *= 1e-3
    plant.coordinates = x
    d_rate, d_output = plant.tangent(command, pushed, direction)
    rate_sum, output_sum = 0.0, 0.0
    for weight, node in zip(STENCIL, range(-4, 5), strict=True):
        rate, output = observed(
            plant, changed_input(command, STEP * node * pushed), x + STEP * node * direction
        )
        rate_sum, output_sum = rate_sum + weight / STEP * rate, output_sum + weight / STEP * output
    got = np.delete(np.frombuffer(bytes(d_output)), np.r_[CONTACT])
    np.testing.assert_allclose(d_rate, rate_sum, atol=DIFFERENCE * np.abs(rate_sum).max())
    np.testing.assert_allclose(got, output_sum, atol=DIFFERENCE * np.abs(output_sum).max())
