"""Computes contacts between the femurs and tibias of neighbouring legs, as capsules (eq. 56),
and their distances.

The femur of a leg has the radius of its knee, the tibia that of its shank. A contact is the point
in the middle of the overlap of two capsules, on the line between the nearest points of their axes;
the force on one leg and the opposite force on the other act at this point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import FootContact
from hexapod_cosim.models.kinematics import JOINTS, LEGS, cross, rotation_matrix
from hexapod_cosim.models.records import Robot

RING = (0, 1, 2, 5, 4, 3)  # legs around the torso: LF LM LR RR RM RF
PARALLEL = 1e-12  # 1  squared sine below which lines are parallel


def nearest_shares(p: Array, a: Array, q: Array, b: Array) -> tuple[float, float]:
    """Returns s and t in [0, 1] of the nearest points of the lines p + s a and q + t b.

    The squared distance is convex in s and t: its minimum is on an edge of the square, where an end
    of one line is nearest to a point of the other, or at the common normal within it.
    """
    pairs = [(share_of(q + t * b - p, a), t) for t in (0.0, 1.0)]
    pairs += [(s, share_of(p + s * a - q, b)) for s in (0.0, 1.0)]
    aa, bb, ab = float(a @ a), float(b @ b), float(a @ b)
    det, r = aa * bb - ab * ab, p - q
    if det > PARALLEL * aa * bb:
        s = np.clip((ab * (b @ r) - bb * (a @ r)) / det, 0.0, 1.0)
        t = np.clip((aa * (b @ r) - ab * (a @ r)) / det, 0.0, 1.0)
        pairs.append((float(s), float(t)))
    return min(pairs, key=lambda at: float(np.linalg.norm(r + at[0] * a - at[1] * b)))


def line_distance(p: Array, a: Array, q: Array, b: Array) -> float:
    """Returns the distance [m] between the lines p + s a and q + t b with s, t in [0, 1]."""
    s, t = nearest_shares(p, a, q, b)
    return float(np.linalg.norm(p - q + s * a - t * b))


def share_of(point: Array, line: Array) -> float:
    """Returns the place on a line from the origin, 0 to 1, that is nearest to a point (3,)."""
    square = float(line @ line)
    return float(np.clip(point @ line / square, 0.0, 1.0)) if square > 0.0 else 0.0


def leg_points(robot: Robot, body: Array) -> Array:
    """Returns the joints of femur and tibia and the foot's centre (6, 3, 3), world axes [m]."""
    points = np.zeros((LEGS, 3, 3))
    for leg, data in enumerate(robot.legs):
        femur, tibia = body[JOINTS * leg + 2], body[JOINTS * leg + 3]
        R_WF, R_WT = rotation_matrix(femur[3:7]), rotation_matrix(tibia[3:7])
        com = np.array(data.links[2].com)
        points[leg, 0] = femur[0:3] - R_WF @ np.array(data.links[1].com)
        points[leg, 1] = tibia[0:3] - R_WT @ com
        points[leg, 2] = tibia[0:3] + R_WT @ (np.array(data.links[2].tip) - com)
    return points


def clearances(robot: Robot, body: Array) -> Array:
    """Returns the least distance (6,) [m] of each leg from its two neighbours around the torso.

    Femur and tibia are capsules of the knee's and the shank's radius; negative: they overlap.
    """
    points = leg_points(robot, body)
    radius = (robot.body.knee_radius, robot.body.shank_radius)
    found = np.full(LEGS, np.inf)
    for k, leg in enumerate(RING):
        other = RING[(k + 1) % LEGS]
        gap = min(
            line_distance(
                points[leg, i],
                points[leg, i + 1] - points[leg, i],
                points[other, j],
                points[other, j + 1] - points[other, j],
            )
            - (radius[i] + radius[j])
            for i in range(2)
            for j in range(2)
        )
        found[[leg, other]] = np.minimum(found[[leg, other]], gap)
    return found


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
