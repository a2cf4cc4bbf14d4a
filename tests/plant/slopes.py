"""Computes derivatives of contact and servo forces by central differences of the twin's forces.

They enter the matrix W = M - z G_v - z^2 G_x of an implicit stage.
"""

from __future__ import annotations

import ctypes as ct
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from plant import Plant, inputs, pointer

from hexapod_cosim.models import Robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import constraints
from hexapod_cosim.models.contact.geometry import (
    foot_contact,
    foot_contacts,
    foot_force,
    standing_damping,
)
from hexapod_cosim.models.dynamics import Command, joint_torques
from hexapod_cosim.models.kinematics import (
    body_states,
    cross,
    foot_centres,
    joint_models,
    quaternion_product,
    rotation_matrix,
    skew,
)

STEP = 1e-7  # step of the central differences in m, rad, m/s


def resting(robot: Robot, seed: int) -> Array:
    """Returns bodies at rest whose joints are satisfied and whose feet are in the ground.

    W's approximate derivatives are exact there, except for geometric stiffness.
    """
    rng = np.random.default_rng(seed)
    still = np.zeros(3)
    place = [robot.stance + rng.normal(0.0, 0.03, (6, 3)), np.zeros((6, 3))]
    body = body_states(robot, still, rng.normal(0.0, 0.02, 4) + np.eye(4)[0], still, still, *place)
    body[:, 2] -= sorted(body_height(robot, body))[3] + 2e-4
    return body


def body_height(robot: Robot, body: Array) -> Array:
    return np.array([-foot.penetration for foot in foot_contacts(robot, body)])


def foot_slopes(robot: Robot, body: Array, leg: int, damping: float) -> tuple[Array, Array]:
    """Returns derivatives (3, 6) of a foot's force by displacement and velocity of its tibia.

    Columns are linear, then angular.
    """
    tibia, centre = body[3 * (leg + 1)], foot_centres(robot, body)[leg]

    def force(displacement: Array, velocity: Array) -> Array:
        moved = tibia.copy()
        moved[0:3] += displacement[0:3]
        moved[7:13] += velocity
        moved[3:7] = quaternion_product(
            np.concatenate([[1.0], displacement[3:6] / 2.0]), tibia[3:7]
        )
        return foot_force(
            robot,
            foot_contact(
                robot,
                moved,
                centre + displacement[0:3] + cross(displacement[3:6], centre - tibia[0:3]),
            ),
            damping,
        )

    still = np.zeros(6)
    by_x = [
        (force(STEP * unit, still) - force(-STEP * unit, still)) / (2.0 * STEP)
        for unit in np.eye(6)
    ]
    by_v = [
        (force(still, STEP * unit) - force(still, -STEP * unit)) / (2.0 * STEP)
        for unit in np.eye(6)
    ]
    return np.array(by_x).T, np.array(by_v).T


def joint_slopes(robot: Robot, command: Command, body: Array) -> tuple[Array, Array]:
    """Returns derivatives (18,) of the joints' torques by their angle and speed."""

    def torque(angle: float, speed: float) -> Array:
        turned = replace(command, angle_ref=command.angle_ref - angle)
        moving = body.copy()
        for model in joint_models(robot):
            s = rotation_matrix(body[model.parent, 3:7]) @ model.s_i
            moving[model.child, 10:13] = moving[model.parent, 10:13] + speed * s
        motor, gear = joint_torques(robot, moving, turned)
        return (motor + gear).ravel()

    by_angle = (torque(STEP, 0.0) - torque(-STEP, 0.0)) / (2.0 * STEP)
    return by_angle, (torque(0.0, STEP) - torque(0.0, -STEP)) / (2.0 * STEP)


@dataclass(frozen=True)
class LawSlopes:
    """Derivatives of the laws: of joint torques (18,), and of foot forces by displacement and
    velocity (3, 3) each.
    """

    by_angle: Array
    by_speed: Array
    feet: dict[int, tuple[Array, Array]]  # legs whose feet are in the ground


def law_slopes(robot: Robot, command: Command, body: Array) -> LawSlopes:
    """Returns the derivatives of the laws for these bodies."""
    damping = standing_damping(robot, body)
    touching = [
        leg for leg, foot in enumerate(foot_contacts(robot, body)) if foot.penetration > 0.0
    ]
    both = {leg: foot_slopes(robot, body, leg, float(damping[leg])) for leg in touching}
    return LawSlopes(
        *joint_slopes(robot, command, body),
        {leg: (by_x[:, :3], by_v[:, :3]) for leg, (by_x, by_v) in both.items()},
    )


def assembled(robot: Robot, body: Array, law: LawSlopes) -> tuple[Array, Array]:
    """Returns the matrices G_x and G_v (114, 114) of these laws, without geometric stiffness, as in
    W.
    """
    G, feet = constraints(robot, body).G, foot_contacts(robot, body)
    G_x, G_v = G.T @ np.diag(law.by_angle) @ G, G.T @ np.diag(law.by_speed) @ G
    for leg, (by_x, by_v) in law.feet.items():
        rows = slice(6 * 3 * (leg + 1), 6 * 3 * (leg + 1) + 6)
        wrench = np.vstack([np.eye(3), skew(feet[leg].point - body[3 * (leg + 1), 0:3])])
        G_x[rows, rows] += wrench @ by_x @ wrench.T
        G_v[rows, rows] += wrench @ by_v @ wrench.T
    return G_x, G_v


def slopes(robot: Robot, command: Command, body: Array) -> tuple[Array, Array]:
    """Returns the matrices G_x and G_v (114, 114) of contacts and servos for these bodies."""
    return assembled(robot, body, law_slopes(robot, command, body))


def rates(core: ct.CDLL, plant: Plant, command: Command) -> Callable[[Array], Array]:
    """Returns dy/dt of the bodies (247,), which the plant computes from them."""

    def rate(y: Array) -> Array:
        plant.bodies = y.reshape(19, 13)
        result, power = np.zeros((19, 13)), np.zeros(3)
        core.hx_probe_rate(
            ct.c_void_p(plant.handle),
            ct.byref(inputs(command)),
            ct.c_double(0.0),
            pointer(result),
            pointer(power),
        )
        return result.ravel()

    return rate
