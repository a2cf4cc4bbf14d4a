"""Tests the reference equations against their definitions and the laws of motion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from states import random_bodies, random_command

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import constraints, joint_reactions
from hexapod_cosim.models.dynamics import (
    accelerations,
    applied_forces,
    drive_acceleration,
    masses,
    world_inertias,
)
from hexapod_cosim.models.kinematics import (
    axis_quaternion,
    cross,
    joint_models,
    joint_speeds,
    quaternion_product,
    rotation_matrix,
)

EXACT = 1e-12  # relative to the size of the compared quantities: about 1e3 roundings
DIFFERENCE = 1e-6  # s, of central differences, whose error is about 1e-8 of the third derivative
DIFFERENCES_AGREE = 1e-6
ROBOTS = ("athena", "phantomx_mk4")
NO_CONTACT = np.full(6, np.nan)


def with_mode(robot: Robot, mode: str) -> Robot:
    return replace(robot, servo=replace(robot.servo, mode=mode))


def advanced(body: Array, dv: Array, h: float) -> Array:
    """Returns the bodies h seconds later, to second order in h."""
    later = body.copy()
    later[:, 0:3] += h * body[:, 7:10] + 0.5 * h * h * dv[:, 0:3]
    later[:, 7:13] += h * dv
    for k, turn in enumerate(h * body[:, 10:13] + 0.5 * h * h * dv[:, 3:6]):
        size = float(np.linalg.norm(turn))
        step = axis_quaternion(turn / size, size) if size > 0.0 else np.array([1.0, 0.0, 0.0, 0.0])
        later[k, 3:7] = quaternion_product(step, body[k, 3:7])
    return later


def close(a: Any, b: Any, tolerance: float) -> bool:
    """Asserts that the largest difference, relative to the largest entry or 1, is within the
    tolerance.
    """
    return float(np.max(np.abs(np.subtract(a, b)))) <= tolerance * max(
        1.0, float(np.max(np.abs(b)))
    )


# kinematics


# constraints, eq. 2-4


@pytest.mark.parametrize("seed", range(3))
def test_constraint_rates_and_gamma_are_the_time_derivatives_of_drifted_constraints(
    seed: int,
) -> None:
    robot = load_robot("phantomx_mk4")
    body = random_bodies(robot, seed, drift=0.05)
    free = np.zeros((19, 6))
    now, later, before = (
        constraints(robot, advanced(body, free, h)) for h in (0.0, DIFFERENCE, -DIFFERENCE)
    )
    assert close((later.phi - before.phi) / (2.0 * DIFFERENCE), now.dphi, DIFFERENCES_AGREE)
    assert close(-(later.dphi - before.dphi) / (2.0 * DIFFERENCE), now.gamma, DIFFERENCES_AGREE)
    assert close(now.D @ body[:, 7:13].ravel(), now.dphi, EXACT)
    assert close(now.G @ body[:, 7:13].ravel(), joint_speeds(robot, body).ravel(), EXACT)


@pytest.mark.parametrize("mode", ["position", "torque", "kinematic"])
def test_accelerations_satisfy_the_stabilised_constraints_and_every_body_balances(
    mode: str,
) -> None:
    robot = with_mode(load_robot("phantomx_mk4"), mode)
    body, command = random_bodies(robot, 4, drift=0.01), random_command(robot, 4)
    command = replace(command, age=0.003)
    result, joints = accelerations(robot, body, command, np.full(6, 5.0)), constraints(robot, body)
    alpha, beta = robot.baumgarte.alpha, robot.baumgarte.beta
    wanted = joints.gamma - 2.0 * alpha * joints.dphi - beta**2 * joints.phi
    assert close(joints.D @ result.dv.ravel(), wanted, 1e-10)

    # balance of each body: child and parent get equal and opposite reactions, each at its own copy
    # of the drifted joint's point
    force, torque = joint_reactions(robot, body, result.multipliers)
    applied = applied_forces(robot, body, command, np.full(6, 5.0))
    rotor = robot.servo.rotor_inertia * (joints.G @ result.dv.ravel())
    on_axis = (result.drive_torque + result.gear_torque).ravel() - rotor
    for k, model in enumerate(joint_models(robot)):
        R_i, R_j = (rotation_matrix(body[number, 3:7]) for number in (model.parent, model.child))
        about_point = torque[k] + on_axis[k] * (R_i @ model.s_i)
        arms = {model.parent: R_i @ model.point_i, model.child: R_j @ model.point_j}
        for sign, number in ((1.0, model.child), (-1.0, model.parent)):
            applied[number] += sign * np.concatenate(
                [force[k], about_point + cross(arms[number], force[k])]
            )
    inertia = np.concatenate(
        [
            masses(robot)[:, None] * result.dv[:, 0:3],
            np.einsum("kij,kj->ki", world_inertias(robot, body), result.dv[:, 3:6]),
        ],
        axis=1,
    )
    assert close(inertia, applied, 1e-9)


# laws of motion


# kinematic drives


def test_a_kinematic_drive_gives_the_commanded_acceleration_and_its_multiplier_is_the_torque() -> (
    None
):
    robot = with_mode(load_robot("athena"), "kinematic")
    body, command = random_bodies(robot, 10), replace(random_command(robot, 10), age=0.003)
    damping = np.full(6, 3.0)
    driven = accelerations(robot, body, command, damping)
    G = constraints(robot, body).G
    assert close(G @ driven.dv.ravel(), drive_acceleration(robot, body, command).ravel(), 1e-10)
    strong = replace(
        robot, servo=replace(robot.servo, mode="torque", torque_max=1e6, speed_max=1e9)
    )
    by_torque = accelerations(
        strong, body, replace(command, torque_ref=driven.drive_torque), damping
    )
    assert close(by_torque.dv, driven.dv, 1e-8)


# feet on the ground, eq. 14 and 15
