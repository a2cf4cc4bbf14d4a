"""Computes rotations, body states from joint angles, and joint angles from body states.

docs/architecture.md has the letters of the frames: R_WB turns components in B into those in W.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array, array_of
from hexapod_cosim.models.errors import check_type
from hexapod_cosim.models.records import Leg, Robot, Torso

LEGS, JOINTS = 6, 3
BODIES = 1 + LEGS * JOINTS
BODY_STATE = 13  # r[3] p[4] v[3] w[3]


def skew(a: Array) -> Array:
    """Returns the (3, 3) matrix with skew(a) b = a x b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def cross(a: Array, b: Array) -> Array:
    """Returns a x b (3,). It is several times as fast as numpy's for single vectors."""
    # Python's floats are the fastest for single numbers
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def rotation_matrix(p: Array) -> Array:
    """Returns the rotation (3, 3), body to world, of a quaternion of any length (eq. 5)."""
    return unit_rotation(*(p / math.sqrt(p @ p)).tolist())


def unit_rotation(w: Any, x: Any, y: Any, z: Any) -> Array:
    """Returns the rotation (3, 3), body to world, of a unit quaternion (eq. 5); of n: (3, 3, n)."""
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def quaternion_rate(p: Array, w: Array) -> Array:
    """Returns dp/dt (4,) of a body with angular velocity w [rad/s], world axes (eq. 6)."""
    return 0.5 * np.concatenate([[-w @ p[1:]], p[0] * w + cross(w, p[1:])])


def quaternion_product(p: Array, q: Array) -> Array:
    """Returns the rotation (4,) q followed by p."""
    (pw, px, py, pz), (qw, qx, qy, qz) = p.tolist(), q.tolist()
    return np.array(
        [
            pw * qw - (px * qx + py * qy + pz * qz),
            pw * qx + qw * px + (py * qz - pz * qy),
            pw * qy + qw * py + (pz * qx - px * qz),
            pw * qz + qw * pz + (px * qy - py * qx),
        ]
    )


def axis_quaternion(axis: Array, angle: float) -> Array:
    """Returns the rotation (4,) by angle [rad] about a unit axis."""
    return np.array([math.cos(angle / 2.0), *(math.sin(angle / 2.0) * axis)])


def axis_rotation(axis: Array, angle: float) -> Array:
    """Returns the rotation (3, 3) by angle [rad] about a unit axis."""
    return rotation_matrix(axis_quaternion(axis, angle))


def inertia_matrix(inertia: tuple[float, ...]) -> Array:
    """Returns the matrix (3, 3) of the entries xx yy zz xy xz yz."""
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def unit_axis(axis: tuple[float, ...]) -> Array:
    """Returns the joint axis (3,) at unit length."""
    vector: Array = np.array(axis)
    return vector / float(np.linalg.norm(vector))


@dataclass(frozen=True)
class JointModel:
    """Constants of the joint between parent i and child j; vectors are in body axes."""

    parent: int  # body number
    child: int
    s_i: Array  # axis, in i
    s_j: Array  # axis, in j
    a_j: Array  # two normals to it, in j
    b_j: Array
    point_i: Array  # centre of mass of i to the joint's point [m]
    point_j: Array  # centre of mass of j to the joint's point [m]
    q_i0: Array  # (4,) from 0, the child's axes at angle 0, to the parent's


def axis_normals(axis: Array) -> tuple[Array, Array]:
    """Returns two unit normals a, b of a unit axis.

    a = axis x e with the coordinate direction e of the axis's smallest component, the first of
    equal ones; b = axis x a.
    """
    least = np.eye(3)[int(np.argmin(np.abs(axis)))]
    a = cross(axis, least)
    a = a / np.linalg.norm(a)
    return a, cross(axis, a)


def joint_models(robot: Robot) -> tuple[JointModel, ...]:
    """Returns the 18 joints, leg by leg; joint k moves body k + 1."""
    return _joint_models(robot.torso, robot.legs)


@lru_cache(maxsize=64)
def _joint_models(torso: Torso, legs: tuple[Leg, ...]) -> tuple[JointModel, ...]:
    return tuple(
        _joint_model(torso, data, leg, joint)
        for leg, data in enumerate(legs)
        for joint in range(JOINTS)
    )


def _joint_model(torso: Torso, data: Leg, leg: int, joint: int) -> JointModel:
    child = 1 + JOINTS * leg + joint
    link, axis = data.links[joint], unit_axis(data.links[joint].axis)
    q_i0 = axis_quaternion(np.array([0.0, 0.0, 1.0]), data.hip_yaw if joint == 0 else 0.0)
    above = data.links[joint - 1]
    from_com = (
        np.subtract(data.hip_position, torso.com)
        if joint == 0
        else np.subtract(above.tip, above.com)
    )
    a_j, b_j = axis_normals(axis)
    return JointModel(
        parent=0 if joint == 0 else child - 1,
        child=child,
        s_i=rotation_matrix(q_i0) @ axis,
        s_j=axis,
        a_j=a_j,
        b_j=b_j,
        point_i=from_com,
        point_j=-np.array(link.com),
        q_i0=q_i0,
    )


def foot_position(leg: Leg, angle: Array) -> Array:
    """Returns the foot's centre (3,) in the torso frame [m] at three joint angles [rad]."""
    p_T = np.array(leg.hip_position)
    R_TP = axis_rotation(np.array([0.0, 0.0, 1.0]), leg.hip_yaw)
    for link, q in zip(leg.links, angle, strict=True):
        R_PL = axis_rotation(unit_axis(link.axis), q)
        R_TP = R_TL = R_TP @ R_PL  # the link is the next one's parent
        tip_L = np.array(link.tip)
        p_T = p_T + R_TL @ tip_L
    return p_T


def foot_positions(robot: Robot, angle: Array) -> Array:
    """Returns the feet's centres (6, 3) in the torso frame [m] at joint angles (6, 3) [rad]."""
    check_type(robot, Robot, "a Robot, as of load_robot()", where="robot")
    angles = array_of(angle, (LEGS, JOINTS), where="angle")
    return np.array([foot_position(leg, q) for leg, q in zip(robot.legs, angles, strict=True)])


def body_states(
    robot: Robot,
    position: Array,
    quaternion: Array,
    velocity: Array,
    angular_velocity: Array,
    angle: Array,
    speed: Array,
) -> Array:
    """Returns the states of all bodies, which satisfy the joints exactly.

    Args:
        position, velocity: (3,) of the torso's centre of mass, world axes [m, m/s].
        quaternion: (4,) torso to world, of any length.
        angular_velocity: (3,) of the torso, world axes [rad/s].
        angle, speed: (6, 3) of the joints [rad, rad/s].

    Returns:
        (19, 13) rows r[3] p[4] v[3] w[3], world axes, at the centres of mass.
    """
    p = np.asarray(quaternion) / np.linalg.norm(quaternion)
    body = np.zeros((BODIES, BODY_STATE))
    body[0] = np.concatenate([position, p, velocity, angular_velocity])
    for k, joint in enumerate(joint_models(robot)):
        q, qd = angle[k // JOINTS][k % JOINTS], speed[k // JOINTS][k % JOINTS]
        body[k + 1] = _child_state(joint, body[joint.parent], q, qd)
    return body


def _child_state(joint: JointModel, parent: Array, q: float, qd: float) -> Array:
    """Returns the child's state (13,) at a joint angle [rad] and speed [rad/s]."""
    r_i, q_Wi, v_i, w_i = split(parent)
    q_W0, q_0j = quaternion_product(q_Wi, joint.q_i0), axis_quaternion(joint.s_j, q)
    q_Wj = quaternion_product(q_W0, q_0j)
    R_Wi, R_Wj = rotation_matrix(q_Wi), rotation_matrix(q_Wj)
    sP_i, sP_j = R_Wi @ joint.point_i, R_Wj @ joint.point_j
    w_j = w_i + qd * (R_Wi @ joint.s_i)
    v_j = v_i + cross(w_i, sP_i) - cross(w_j, sP_j)
    return np.concatenate([r_i + sP_i - sP_j, q_Wj, v_j, w_j])


def split(state: Array) -> tuple[Array, Array, Array, Array]:
    """Returns r, p, v, w of a body's state (13,)."""
    return state[0:3], state[3:7], state[7:10], state[10:13]


def joint_angle(joint: JointModel, parent: Array, child: Array) -> float:
    """Returns the joint's angle [rad] in (-pi, pi].

    It is the twist about the axis, so that small violations of the joint do not enter to first
    order.
    """
    q_Wi, q_Wj = parent[3:7], child[3:7]
    q_0W = quaternion_product(q_Wi, joint.q_i0) * np.array([1.0, -1.0, -1.0, -1.0])
    q_0j = quaternion_product(q_0W, q_Wj)
    angle = 2.0 * np.arctan2(joint.s_j @ q_0j[1:], q_0j[0])
    return float(angle - 2.0 * np.pi * np.ceil((angle - np.pi) / (2.0 * np.pi)))


def joint_speed(joint: JointModel, parent: Array, child: Array) -> float:
    """Returns the joint's speed s . (w_j - w_i) [rad/s]."""
    s = rotation_matrix(parent[3:7]) @ joint.s_i
    return float(s @ (child[10:13] - parent[10:13]))


def joint_angles(robot: Robot, body: Array) -> Array:
    """Returns the angles (6, 3) [rad] of bodies (19, 13), whose joints may have drifted."""
    angles = [
        joint_angle(joint, body[joint.parent], body[joint.child]) for joint in joint_models(robot)
    ]
    return np.array(angles).reshape(LEGS, JOINTS)


def joint_speeds(robot: Robot, body: Array) -> Array:
    """Returns the speeds (6, 3) [rad/s] of bodies (19, 13), whose joints may have drifted."""
    speeds = [
        joint_speed(joint, body[joint.parent], body[joint.child]) for joint in joint_models(robot)
    ]
    return np.array(speeds).reshape(LEGS, JOINTS)


def foot_centres(robot: Robot, body: Array) -> Array:
    """Returns the feet's centres (6, 3), world axes [m], of bodies (19, 13)."""
    tibias = body[JOINTS::JOINTS]
    points = [np.array(leg.links[-1].tip) - np.array(leg.links[-1].com) for leg in robot.legs]
    return np.array(
        [
            state[0:3] + rotation_matrix(state[3:7]) @ p_S
            for state, p_S in zip(tibias, points, strict=True)
        ]
    )
