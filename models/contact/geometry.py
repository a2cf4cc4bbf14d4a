"""Computes where spheres touch the ground, how fast, and with which force and moment.

The normal force is that of law.py, friction that of friction.py; the moments of spin and rolling
(eq. 38) follow from both. The force of a foot is shared
among faces, edges and corners of blocks that are close on it (`contact_shares`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.law import Contact, contact_damping, normal_force
from hexapod_cosim.models.friction import (
    Friction,
    friction_direction,
    friction_force,
    stribeck_curve,
)
from hexapod_cosim.models.ground.faces import Face, ground_faces
from hexapod_cosim.models.kinematics import JOINTS, LEGS, cross, foot_centres, skew
from hexapod_cosim.models.records import Robot


@dataclass(frozen=True)
class FootContact:
    """Contact of a foot with the ground, world axes."""

    point: Array  # (3,) m    centre - R n
    velocity: Array  # (3,) m/s  of the foot's material at the contact point
    normal: Array  # (3,)
    penetration: float  # m    delta, < 0: clearance
    approach_speed: float  # m/s  ddelta


def foot_contact(robot: Robot, tibia: Array, centre: Array) -> FootContact:
    """Returns the contact of a foot with the ground below it.

    It is that of the surface, or of the top of the block over which the foot's centre is.

    Args:
        robot: the robot.
        tibia: (13,) state of the foot's tibia.
        centre: (3,) of the foot [m].
    """
    return sphere_contact(tibia, centre, robot.foot.radius, ground_faces(robot.terrain, centre)[0])


def sphere_contact(state: Array, centre: Array, radius: float, face: Face) -> FootContact:
    """Returns the contact of a sphere with one face of the ground.

    Args:
        state: (13,) of the body that carries the sphere.
        centre: (3,) of the sphere, world axes [m].
        radius: of the sphere [m].
        face: distance of the centre from the ground [m], and the ground's normal (3,).
    """
    distance, normal = face
    point = centre - radius * normal
    velocity = state[7:10] + cross(state[10:13], point - state[0:3])
    return FootContact(point, velocity, normal, radius - distance, float(-velocity @ normal))


def foot_contacts(robot: Robot, body: Array) -> tuple[FootContact, ...]:
    """Returns the contacts of the six feet of bodies (19, 13)."""
    centres = foot_centres(robot, body)
    return tuple(foot_contact(robot, body[JOINTS * (leg + 1)], centres[leg]) for leg in range(LEGS))


def foot_force(
    robot: Robot, foot: FootContact, damping: float, bristle: Array | None = None
) -> Array:
    """Returns the force (3,) of the ground on the foot [N]: f_n n + f_t.

    bristle: (3,) as in `friction_force`.
    """
    f_n = normal_force(robot.contact, damping, foot.penetration, foot.approach_speed)
    friction = friction_force(robot.friction, f_n, slip_velocity(foot), bristle)
    return f_n * foot.normal + friction


def foot_moment(robot: Robot, foot: FootContact, damping: float, w: Array) -> Array:
    """Returns the moment (3,) of spin and rolling friction on the tibia [N m] (eq. 38).

    w: angular velocity (3,) of the tibia [rad/s].
    """
    f_n = normal_force(robot.contact, damping, foot.penetration, foot.approach_speed)
    return turning_moment(robot.friction, robot.foot.radius, f_n, foot.normal, w)


def turning_slopes(
    friction: Friction, radius: float, normal: Array, w: Array
) -> tuple[float, float]:
    """Returns the moments of spin and rolling friction over load and angular speed [m s] (eq. 38).

    radius: that of the sphere [m]; its speeds R |w_n| and R |w_t| regularise the moments.
    normal: (3,) of the ground; w: angular velocity (3,) [rad/s].
    """
    spin = float(normal @ w)
    slow = radius * abs(spin)
    fast = radius * float(np.linalg.norm(w - spin * normal))
    about = float(stribeck_curve(friction, slow)) * friction_direction(friction, slow)
    across = friction_direction(friction, fast)
    return friction.spin_radius * radius * about, friction.rolling_radius * radius * across


def turning_moment(
    friction: Friction, radius: float, load: float, normal: Array, w: Array
) -> Array:
    """Returns the moment (3,) [N m] of spin and rolling friction at a load [N] (eq. 38).

    The other arguments are those of `turning_slopes`.
    """
    spin, roll = turning_slopes(friction, radius, normal, w)
    about = float(normal @ w) * normal
    return -load * (spin * about + roll * (w - about))


def slip_velocity(contact: FootContact) -> Array:
    """Returns the velocity (3,) of the contact point's material along the ground [m/s]."""
    return contact.velocity + contact.approach_speed * contact.normal


def standing_damping(robot: Robot, body: Array) -> Array:
    """Returns the damping (6,) [s/m] at impact speed 0; nan for feet above the ground."""
    return resting_damping(robot.contact, foot_contacts(robot, body))


def resting_damping(law: Contact, contacts: Iterable[FootContact]) -> Array:
    """Returns the damping (n,) [s/m] at impact speed 0; nan for contacts above the ground."""
    slow = contact_damping(law, 0.0)
    return np.array([slow if contact.penetration > 0.0 else math.nan for contact in contacts])


def contact_jacobian(body: Array, carrier: int, contact: FootContact) -> Array:
    """Returns J (3, 114): the velocity of the contact point's material is J v.

    carrier: number of the body that touches.
    """
    J = np.zeros((3, 6 * len(body)))
    J[:, 6 * carrier : 6 * carrier + 3] = np.eye(3)
    J[:, 6 * carrier + 3 : 6 * carrier + 6] = -skew(contact.point - body[carrier, 0:3])
    return J


def contact_matrices(
    J: Array, normal: Array, *, stiffness: float, viscosity: float, drag: float
) -> tuple[Array, Array]:
    """Returns the parts of G_x and G_v of eq. 20, each (114, 114), of one contact.

    Args:
        J: (3, 114) as in `contact_jacobian`.
        normal: (3,) of the ground.
        stiffness: of the normal force by delta [N/m].
        viscosity: of the normal force by ddelta [N s/m].
        drag: of friction by slip velocity [N s/m].
    """
    nn = np.outer(normal, normal)
    across = drag * (np.eye(3) - nn)
    return -J.T @ (stiffness * nn) @ J, -J.T @ (viscosity * nn + across) @ J


REACH = 25.0  # 1  of rho^2; 20 gives phi the slope of a hidden depth, more is on the safe side
SINGULAR = 1e-9  # 1  least determinant of a G whose contacts count as different


def overlap(first: Array, second: Array, reach: float) -> float:
    """Returns G_ij of two unit normals (3,) (eq. 59).

    reach: 1/rho^2, or 0 where rho is infinite.
    """
    square = float(np.sum((first - second) ** 2))
    ratio = np.sqrt(square * reach)
    if ratio >= 1.0:
        return 0.0
    return float((1.0 - 0.5 * square) * (1.0 - ratio) ** 4 * (4.0 * ratio + 1.0))


def contact_shares(depth: Array, normal: Array, radius: float) -> Array:
    """Returns the shares w (n,) of contacts of one sphere, 0 to 1 (eq. 59).

    Args:
        depth: (n,) m, > 0.
        normal: (n, 3) out of the ground.
        radius: of the sphere [m].
    """
    count, deepest = len(depth), float(np.max(depth, initial=0.0))
    if count < 2:
        return np.ones(count)
    reach = max((radius - 2.0 * deepest) / (REACH * deepest), 0.0)
    G = np.array([[overlap(a, b, reach) for b in normal] for a in normal])
    best, shares = -1.0, np.ones(count)
    for size in range(1, count + 1):
        for chosen in combinations(range(count), size):
            part, right = G[np.ix_(chosen, chosen)], depth[list(chosen)]
            if np.linalg.det(part) <= SINGULAR:
                continue
            force = np.linalg.solve(part, right)
            if np.all(force >= 0.0) and float(force @ right) > best:
                best, shares = float(force @ right), np.zeros(count)
                shares[list(chosen)] = force / right
    return shares
