"""Computes the forces out of balance of a standing robot, and their derivatives.

The unknowns (24,) are the torso's height z, roll and pitch, creep (vx, vy, yaw rate) and the joint
angles; under laws with bristles the creep stands for their deflections.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexapod_cosim.models.actuator import overrun, servo_torque, stop_torque
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import foot_contacts, foot_force, foot_moment
from hexapod_cosim.models.dynamics import masses
from hexapod_cosim.models.ground.faces import ground_normal
from hexapod_cosim.models.kinematics import (
    JOINTS,
    LEGS,
    axis_quaternion,
    body_states,
    cross,
    joint_models,
    quaternion_product,
    rotation_matrix,
)
from hexapod_cosim.models.records import Robot

DIFFERENCE = 1e-7  # 1  step of the Jacobian's differences
TORSO = 6  # the torso's unknowns and residuals
UNKNOWNS = TORSO + LEGS * JOINTS


def start_unknowns(robot: Robot) -> Array:
    """Returns the first unknowns: z, roll, pitch, creep (vx, vy, yaw rate), joint angles.

    The robot is in its stance, parallel to the ground, with the feet at the depth that carries it.
    """
    x = np.zeros(UNKNOWNS)
    normal = ground_normal(robot.terrain)
    x[1], x[2] = -np.arcsin(normal[1]), np.arctan2(normal[0], normal[2])
    x[6:] = robot.stance.ravel()
    depth = (robot.weight / LEGS / robot.contact.stiffness) ** (2.0 / 3.0)
    highest = min(foot.penetration for foot in foot_contacts(robot, moving_bodies(robot, x)))
    x[0] += (highest - depth) / normal[2]
    return x


def attitude(x: Array) -> Array:
    """Returns the torso's quaternion (4,) of the unknowns."""
    q_VT = axis_quaternion(np.array([1.0, 0.0, 0.0]), x[1])  # roll
    q_WV = axis_quaternion(np.array([0.0, 1.0, 0.0]), x[2])  # pitch
    return quaternion_product(q_WV, q_VT)


def creep_velocity(robot: Robot, x: Array) -> Array:
    """Returns the creep velocity (3,) along the ground [m/s]."""
    normal = ground_normal(robot.terrain)
    return np.array([x[3], x[4], -(normal[0] * x[3] + normal[1] * x[4]) / normal[2]])


def moving_bodies(robot: Robot, x: Array) -> Array:
    """Returns the bodies (19, 13) of the unknowns, all moving with the creep."""
    position, velocity = np.array([0.0, 0.0, x[0]]), creep_velocity(robot, x)
    turning, still = x[5] * ground_normal(robot.terrain), np.zeros((LEGS, JOINTS))
    angle = x[6:].reshape(LEGS, JOINTS)
    return body_states(robot, position, attitude(x), velocity, turning, angle, still)


def deflections(robot: Robot, body: Array) -> Array:
    """Returns the bristles' deflections (6, 3) [m], 0 with other laws.

    The unknown creep stands for the deflection: one presliding for each m/s.
    """
    if not robot.friction.has_bristles:
        return np.zeros((LEGS, 3))
    return np.array(
        [
            robot.friction.presliding * (foot.velocity + foot.approach_speed * foot.normal)
            for foot in foot_contacts(robot, body)
        ]
    )


def foot_forces(robot: Robot, body: Array) -> Array:
    """Returns the forces (6, 3) of the ground on the feet [N]; feet with bristles are at rest."""
    feet, bristle = foot_contacts(robot, body), deflections(robot, body)
    if robot.friction.has_bristles:
        feet = tuple(replace(foot, velocity=np.zeros(3), approach_speed=0.0) for foot in feet)
    return np.array([foot_force(robot, foot, 0.0, bristle[leg]) for leg, foot in enumerate(feet)])


def imbalance(robot: Robot, loads: Array) -> Array:
    """Returns what is out of balance (24,): force and moment on the torso, each joint's torque.

    For kinematic drives the last are the deviations from the stance [rad].
    """
    weight = robot.torso.mass * np.array([*robot.gravity, 0.0, 0.0, 0.0])
    return np.concatenate([weight + loads[:, :TORSO].sum(axis=0), loads[:, TORSO:].ravel()])


def leg_loads(robot: Robot, x: Array) -> Array:
    """Returns (6, 9): each leg's force and moment on the torso, and its joints' residuals.

    Force and moment act at the torso's centre of mass, world axes.
    """
    body = moving_bodies(robot, x)
    force = masses(robot)[:, None] * np.array(robot.gravity)
    moment = np.zeros_like(force)
    for leg, (foot, push) in enumerate(
        zip(foot_contacts(robot, body), foot_forces(robot, body), strict=True)
    ):
        tibia = JOINTS * (leg + 1)
        force[tibia] += push
        moment[tibia] += cross(foot.point - body[tibia, 0:3], push)
        if not robot.friction.has_bristles:
            moment[tibia] += foot_moment(robot, foot, 0.0, body[tibia, 10:13])
    on_torso, left_over = _carry_to_torso(robot, body, force, moment)
    angle = x[TORSO:]
    if robot.servo.mode == "kinematic":
        left_over = robot.stance.ravel() - angle
    else:
        servo, zero = replace(robot.servo, mode="position"), np.zeros_like(angle)
        left_over += servo_torque(servo, angle, zero, robot.stance.ravel(), zero, zero)
        past = overrun(angle, robot.angle_min.ravel(), robot.angle_max.ravel())
        left_over += stop_torque(servo, past, zero)
    return np.column_stack([on_torso, left_over.reshape(LEGS, JOINTS)])


def _carry_to_torso(robot: Robot, body: Array, force: Array, moment: Array) -> tuple[Array, Array]:
    """Adds each link's force and moment to its parent's, leaf to root, in place.

    Returns the legs' forces and moments on the torso (6, 6), and the torques about the joint axes
    (18,).
    """
    on_torso, torque = np.zeros((LEGS, TORSO)), np.zeros(LEGS * JOINTS)
    for k, joint in reversed(list(enumerate(joint_models(robot)))):
        i, j = joint.parent, joint.child
        R_Wi = rotation_matrix(body[i, 3:7])
        sP_i = R_Wi @ joint.point_i
        at_joint = moment[j] + cross(body[j, 0:3] - (body[i, 0:3] + sP_i), force[j])
        torque[k] = at_joint @ (R_Wi @ joint.s_i)
        carried = at_joint + cross(sP_i, force[j])
        if i == 0:
            on_torso[k // JOINTS] = np.concatenate([force[j], carried])
        else:
            force[i] += force[j]
            moment[i] += carried
    return on_torso, torque


def imbalance_slopes(robot: Robot, x: Array, loads: Array) -> Array:
    """Returns the Jacobian (24, 24) of `imbalance` by differences.

    The loads of a leg do not depend on other legs' angles, so that all legs move at once.
    """

    def change(direction: Array) -> Array:
        return (leg_loads(robot, x + DIFFERENCE * direction) - loads) / DIFFERENCE

    jacobian = np.zeros((UNKNOWNS, UNKNOWNS))
    for column, unit in enumerate(np.eye(UNKNOWNS)[:TORSO]):
        changed = change(unit)
        jacobian[:, column] = np.concatenate(
            [changed[:, :TORSO].sum(axis=0), changed[:, TORSO:].ravel()]
        )
    for joint, unit in enumerate(np.eye(JOINTS)):
        changed = change(np.concatenate([np.zeros(TORSO), np.tile(unit, LEGS)]))
        for leg in range(LEGS):
            begin = TORSO + JOINTS * leg
            jacobian[:TORSO, begin + joint] = changed[leg, :TORSO]
            jacobian[begin : begin + JOINTS, begin + joint] = changed[leg, TORSO:]
    return jacobian
