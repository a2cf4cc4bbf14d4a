"""Computes contacts between the femurs and tibias of neighbouring legs, as capsules (eq. 59).

The femur of a leg has the radius of its knee, the tibia that of its shank. A contact is the point
in the middle of the overlap of two capsules, on the line between the nearest points of their axes;
the force on one leg and the opposite force on the other act at this point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.clearance import RING, leg_points, nearest_shares
from hexapod_cosim.models.contact.geometry import FootContact
from hexapod_cosim.models.kinematics import JOINTS, LEGS, cross
from hexapod_cosim.models.records import Robot

LINES = 2  # femur and tibia
NEXT = {leg: RING[(k + 1) % LEGS] for k, leg in enumerate(RING)}


@dataclass(frozen=True)
class Pair:
    """A femur or tibia of a leg, and one of the next leg around the torso."""

    leg: int
    line: int  # 0: the leg's femur, 1: its tibia
    other_line: int  # the same of the next leg

    @property
    def body(self) -> int:
        """Number of the leg's body."""
        return JOINTS * self.leg + 2 + self.line

    @property
    def other_body(self) -> int:
        """Number of the next leg's body."""
        return JOINTS * NEXT[self.leg] + 2 + self.other_line


def leg_pairs(robot: Robot) -> tuple[Pair, ...]:
    """Returns all pairs in the order of the C plant; none unless body.self_contact is force."""
    if robot.body.self_contact != "force":
        return ()
    lines = [(line, other) for line in range(LINES) for other in range(LINES)]
    return tuple(Pair(leg, line, other) for line, other in lines for leg in range(LEGS))


def pair_contact(robot: Robot, body: Array, points: Array, pair: Pair) -> FootContact:
    """Returns the contact of a pair at bodies (19, 13).

    The normal points from the axis of the next leg's part to that of the leg's part, and is 0 where
    the axes meet; the velocity is that of the leg's material relative to the next leg's.

    Args:
        robot: the robot.
        body: (19, 13) states.
        points: (6, 3, 3) as of `leg_points` [m].
        pair: the pair.
    """
    radius = (robot.body.knee_radius, robot.body.shank_radius)
    own, other = points[pair.leg], points[NEXT[pair.leg]]
    p, a = own[pair.line], own[pair.line + 1] - own[pair.line]
    q, b = other[pair.other_line], other[pair.other_line + 1] - other[pair.other_line]
    s, t = nearest_shares(p, a, q, b)
    apart = p - q + s * a - t * b
    distance = float(np.linalg.norm(apart))
    normal = apart / distance if distance > 0.0 else np.zeros(3)
    depth = radius[pair.line] + radius[pair.other_line] - distance
    point = p + s * a - (radius[pair.line] - 0.5 * depth) * normal
    velocity = _velocity(body[pair.body], point) - _velocity(body[pair.other_body], point)
    return FootContact(point, velocity, normal, depth, float(-velocity @ normal))


def _velocity(state: Array, point: Array) -> Array:
    """Returns the velocity (3,) of a body's material at a point (3,) [m/s]; state: (13,)."""
    return np.asarray(state[7:10] + cross(state[10:13], point - state[0:3]))


def pair_contacts(robot: Robot, body: Array) -> list[FootContact]:
    """Returns the contacts of all pairs of `leg_pairs` at bodies (19, 13)."""
    pairs = leg_pairs(robot)
    if not pairs:
        return []
    points = leg_points(robot, body)
    return [pair_contact(robot, body, points, pair) for pair in pairs]
