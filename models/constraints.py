"""Computes the constraints of the joints (eq. 2-4), their reactions, and the projection onto them.

Velocities are stacked body by body, v then w, world axes: 19 x 6 = 114. Each joint has 5
multipliers: 18 x 5 = 90.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import (
    BODIES,
    JOINTS,
    LEGS,
    JointModel,
    cross,
    joint_models,
    quaternion_product,
    rotation_matrix,
    skew,
    split,
)
from hexapod_cosim.models.records import Robot

MULTIPLIERS = 5


@dataclass(frozen=True)
class JointKinematics:
    """Constraint of a joint: rows 1-3 fix the point, rows 4-5 the axis."""

    phi: Array  # (5,)  Phi
    dphi: Array  # (5,)  its rate
    D_i: Array  # (5, 6)  Jacobian on the parent's (v, w)
    D_j: Array  # (5, 6)  on the child's
    gamma: Array  # (5,)  -dD/dt (v, w)
    s: Array  # (3,)  axis, world


def joint_kinematics(joint: JointModel, parent: Array, child: Array) -> JointKinematics:
    """Returns eq. 2-4 of the joint between two bodies (13,), which may have drifted.

    The first row of gamma contains the time derivatives that the paper's print lacks.
    """
    (r_i, p_i, v_i, w_i), (r_j, p_j, v_j, w_j) = split(parent), split(child)
    R_Wi, R_Wj = rotation_matrix(p_i), rotation_matrix(p_j)
    sP_i, sP_j, s = R_Wi @ joint.point_i, R_Wj @ joint.point_j, R_Wi @ joint.s_i
    a, b = R_Wj @ joint.a_j, R_Wj @ joint.b_j

    # Phi = (r_j + s_j^P - r_i - s_i^P,  a.s,  b.s)
    phi = np.concatenate([r_j + sP_j - r_i - sP_i, [a @ s, b @ s]])

    # D = [-1, skew(s_i^P), 1, -skew(s_j^P);  0, -a^T skew(s), 0, -s^T skew(a);  the same with b]
    one, none = np.eye(3), np.zeros(3)
    D_i = np.block([[-one, skew(sP_i)], [none, -a @ skew(s)], [none, -b @ skew(s)]])
    D_j = np.block([[one, -skew(sP_j)], [none, -s @ skew(a)], [none, -s @ skew(b)]])
    dphi = D_i @ np.concatenate([v_i, w_i]) + D_j @ np.concatenate([v_j, w_j])

    # gamma = (-skew(ds_i^P) w_i + skew(ds_j^P) w_j,
    #          -s^T skew(w_j) da - a^T skew(w_i) ds - 2 da.ds,  the same with b)
    dsP_i, dsP_j, ds = cross(w_i, sP_i), cross(w_j, sP_j), cross(w_i, s)
    rows = [
        -s @ skew(w_j) @ dn - n @ skew(w_i) @ ds - 2.0 * dn @ ds
        for n, dn in ((a, cross(w_j, a)), (b, cross(w_j, b)))
    ]
    gamma = np.concatenate([-skew(dsP_i) @ w_i + skew(dsP_j) @ w_j, rows])
    return JointKinematics(phi, dphi, D_i, D_j, gamma, s)


@dataclass(frozen=True)
class Constraints:
    """Constraints of all joints, stacked."""

    phi: Array  # (90,)
    dphi: Array  # (90,)
    D: Array  # (90, 114)
    gamma: Array  # (90,)
    G: Array  # (18, 114)  joint speeds: qd = G v


def constraints(robot: Robot, body: Array) -> Constraints:
    """Returns the constraint equations of the joints between bodies (19, 13)."""
    models = joint_models(robot)
    joints = [joint_kinematics(model, body[model.parent], body[model.child]) for model in models]
    D, G = np.zeros((MULTIPLIERS * len(models), 6 * BODIES)), np.zeros((len(models), 6 * BODIES))
    for k, (model, joint) in enumerate(zip(models, joints, strict=True)):
        rows = slice(MULTIPLIERS * k, MULTIPLIERS * (k + 1))
        i, j = 6 * model.parent, 6 * model.child
        D[rows, i : i + 6], D[rows, j : j + 6] = joint.D_i, joint.D_j
        G[k, i + 3 : i + 6], G[k, j + 3 : j + 6] = -joint.s, joint.s
    stack = [
        np.concatenate([getattr(joint, name) for joint in joints])
        for name in ("phi", "dphi", "gamma")
    ]
    return Constraints(phi=stack[0], dphi=stack[1], D=D, gamma=stack[2], G=G)


def constraint_errors(robot: Robot, body: Array) -> tuple[float, float]:
    """Returns the norms of Phi [m or 1] and of its rate [m/s or 1/s]."""
    joints = constraints(robot, body)
    return float(np.linalg.norm(joints.phi)), float(np.linalg.norm(joints.dphi))


def project(robot: Robot, body: Array) -> Array:
    """Returns the bodies (19, 13), projected onto their joints from hip to foot.

    The smallest rotation q_WV aligns the axis, a translation restores the joint's point, and
    velocities keep only the rotation about the axis.
    """
    body = body.copy()
    for joint in joint_models(robot):
        parent, child = body[joint.parent], body[joint.child]
        R_Wi, q_Vj = rotation_matrix(parent[3:7]), child[3:7]
        s, z = R_Wi @ joint.s_i, rotation_matrix(q_Vj) @ joint.s_j
        q_WV = np.concatenate([[1.0 + z @ s], cross(z, s)])
        child[3:7] = quaternion_product(q_WV / np.linalg.norm(q_WV), q_Vj)
        child[10:13] = parent[10:13] + (s @ (child[10:13] - parent[10:13])) * s
        sP_i, sP_j = R_Wi @ joint.point_i, rotation_matrix(child[3:7]) @ joint.point_j
        child[0:3] = parent[0:3] + sP_i - sP_j
        child[7:10] = parent[7:10] + cross(parent[10:13], sP_i) - cross(child[10:13], sP_j)
    return body


def joint_reactions(robot: Robot, body: Array, multipliers: Array) -> tuple[Array, Array]:
    """Returns force (18, 3) [N] and torque (18, 3) [N m] of each joint on its child.

    They are -D_j^T lambda; the torque is about the joint's point.
    """
    force, torque = np.zeros((LEGS * JOINTS, 3)), np.zeros((LEGS * JOINTS, 3))
    for k, model in enumerate(joint_models(robot)):
        joint = joint_kinematics(model, body[model.parent], body[model.child])
        wrench = -joint.D_j.T @ multipliers[k]
        sP_j = rotation_matrix(body[model.child, 3:7]) @ model.point_j
        force[k], torque[k] = wrench[0:3], wrench[3:6] - cross(sP_j, wrench[0:3])
    return force, torque
