"""A standing leg seen from its foot: stiffness, damping and inertia of the servos and links, in the torso frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexapod_cosim.controller.gains import TRIPOD_LEGS
from hexapod_cosim.controller.kinematics import Array, LegSolver
from hexapod_cosim.models import Leg, Robot
from hexapod_cosim.models.kinematics import axis_rotation, inertia_matrix, unit_axis


@dataclass(frozen=True)
class FootDynamics:
    """M x'' + D x' + K x = f for small foot motions x about the stance with the torso held; (3, 3) each, torso axes."""

    inertia: Array  # kg
    damping: Array  # N s/m
    stiffness: Array  # N/m


@dataclass(frozen=True)
class Direction:
    """One horizontal direction of one foot: scalar inertia [kg], damping [N s/m], stiffness [N/m]."""

    inertia: float
    damping: float
    stiffness: float


def joint_inertia(leg: Leg, *, rotor_inertia: float) -> Array:
    """(3, 3) inertia of a leg about its joints at the stance [kg m2]: sum of m Jv^T Jv + Jw^T I Jw, and the rotors."""
    inertia = np.eye(3) * rotor_inertia
    point, rotation = np.zeros(3), np.eye(3)
    axes, origins = np.zeros((3, 3)), np.zeros((3, 3))
    for joint, (link, q) in enumerate(zip(leg.links, leg.stance, strict=True)):
        axes[joint], origins[joint] = rotation @ unit_axis(link.axis), point
        rotation = rotation @ axis_rotation(unit_axis(link.axis), q)
        com = point + rotation @ np.array(link.com)
        turning = np.zeros((3, 3))
        turning[:, : joint + 1] = axes[: joint + 1].T
        moving = np.cross(turning.T, com - origins).T
        inertia += link.mass * moving.T @ moving + turning.T @ rotation @ inertia_matrix(link.inertia) @ rotation.T @ turning
        point = point + rotation @ np.array(link.tip)
    return inertia


def foot_dynamics(robot: Robot) -> list[FootDynamics]:
    """The six standing legs at their feet: K = J^-T kp J^-1, and alike the damping and the inertia."""
    stance = np.array([leg.stance for leg in robot.legs])
    inverse = np.linalg.inv(LegSolver(robot).jacobian(stance))
    return [
        FootDynamics(
            inertia=g.T @ joint_inertia(leg, rotor_inertia=robot.servo.rotor_inertia) @ g,
            damping=robot.servo.kd * g.T @ g,
            stiffness=robot.servo.kp * g.T @ g,
        )
        for leg, g in zip(robot.legs, inverse, strict=True)
    ]


def extreme_directions(robot: Robot) -> tuple[Direction, Direction]:
    """The softest and the stiffest horizontal direction of all feet, the feet's height held by the ground."""
    found = []
    for foot in foot_dynamics(robot):
        values, vectors = np.linalg.eigh(foot.stiffness[:2, :2])
        for value, e in zip(values, vectors.T, strict=True):
            found.append(Direction(float(e @ foot.inertia[:2, :2] @ e), float(e @ foot.damping[:2, :2] @ e), float(value)))
    found.sort(key=lambda direction: direction.stiffness)
    return found[0], found[-1]


def stiffest_vertical(robot: Robot) -> Direction:
    """The vertical direction of the stiffest leg, its foot held sideways by friction."""
    feet = [Direction(float(f.inertia[2, 2]), float(f.damping[2, 2]), float(f.stiffness[2, 2])) for f in foot_dynamics(robot)]
    return max(feet, key=lambda direction: direction.stiffness)


def vertical_compliance(robot: Robot) -> float:
    """m/N    sag of a foot per vertical load, free to move sideways: (J kp^-1 J^T)_zz, mean of the legs"""
    jacobian = LegSolver(robot).jacobian(np.array([leg.stance for leg in robot.legs]))
    return float((jacobian[:, 2, :] ** 2).sum(axis=1).mean() / robot.servo.kp)


def weight_share(robot: Robot) -> float:
    """N    one leg's share of the weight while three legs stand"""
    return robot.total_mass * float(np.linalg.norm(robot.gravity)) / TRIPOD_LEGS
