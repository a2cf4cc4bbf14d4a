"""Computes contacts of torso, knees and shanks with the ground, and of neighbouring legs with each
other (eq. 56).

Torso, knees and shanks have spheres with the normal law of the feet (eq. 14) and the friction of
the tanh law (eq. 15), also where the feet have bristles. The torso has eight, around the corners of
a box. Soil is rigid ground for them.

Femur and tibia of a leg are capsules with the radius of its knee and its shank. A contact is the
point in the middle of the overlap of two capsules, on the line between the nearest points of their
axes; the force on one leg and the opposite force on the other act at this point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import FootContact, resting_damping, sphere_contact
from hexapod_cosim.models.contact.law import ContactState, contact_damping
from hexapod_cosim.models.ground.faces import ground
from hexapod_cosim.models.kinematics import JOINTS, LEGS, cross, rotation_matrix
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.soil.presets import Soil

RING = (0, 1, 2, 5, 4, 3)  # legs around the torso: LF LM LR RR RM RF
NEXT = {leg: RING[(k + 1) % LEGS] for k, leg in enumerate(RING)}
PARALLEL = 1e-12  # 1  squared sine below which lines are parallel


@dataclass(frozen=True)
class BodySphere:
    """A sphere of a body that may touch the ground."""

    name: str  # torso, LF.knee, LF.shank, ...
    body: int  # number of the body
    centre: Array  # (3,) from the body's centre of mass, body axes [m]
    radius: float  # m


def body_spheres(robot: Robot) -> tuple[BodySphere, ...]:
    """Returns the spheres of torso, knees and shanks; none without contact of the body.

    The order is that of the C plant: the torso's corners, of which bit i of the number chooses the
    side along axis i, then the knees, then the shanks.
    """
    body = robot.body
    if body.contact == "off":
        return ()
    spheres = []
    if any(body.torso_box):
        offset = np.subtract(body.torso_centre, robot.torso.com)
        for z, y, x in product((-1.0, 1.0), repeat=3):
            corner = offset + np.array([x, y, z]) * body.torso_box
            spheres.append(BodySphere("torso", 0, corner, body.corner_radius))
    for name, radius, share in body.tibia_spheres:
        for leg in range(LEGS):
            tibia = robot.legs[leg].links[-1]
            centre = share * np.array(tibia.tip) - np.array(tibia.com)
            label = f"{robot.legs[leg].name}.{name}"
            spheres.append(BodySphere(label, JOINTS * (leg + 1), centre, radius))
    return tuple(spheres)


def body_contact(robot: Robot, sphere: BodySphere, state: Array) -> FootContact:
    """Returns the contact of a sphere with the nearest face of the ground.

    state: (13,) of the sphere's body.
    """
    centre = state[0:3] + rotation_matrix(state[3:7]) @ sphere.centre
    return sphere_contact(state, centre, sphere.radius, ground(robot.terrain, centre))


def body_contacts(robot: Robot, body: Array) -> tuple[FootContact, ...]:
    """Returns the contacts of all spheres of `body_spheres`, at bodies (19, 13)."""
    return tuple(body_contact(robot, sphere, body[sphere.body]) for sphere in body_spheres(robot))


def standing_body_damping(robot: Robot, body: Array) -> Array:
    """Returns the damping of all spheres [s/m] at impact speed 0; nan for those above the
    ground.
    """
    return resting_damping(robot.contact, body_contacts(robot, body))


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


def share_of(point: Array, line: Array) -> float:
    """Returns the place on a line from the origin, 0 to 1, that is nearest to a point (3,)."""
    square = float(line @ line)
    return float(np.clip(point @ line / square, 0.0, 1.0)) if square > 0.0 else 0.0


def leg_points(robot: Robot, body: Array) -> Array:
    """Returns the joints of femur and tibia and the foot's centre (6, 3, 3), world axes [m]."""
    points = np.zeros((LEGS, 3, 3))
    for leg, data in enumerate(robot.legs):
        femur, tibia = body[JOINTS * leg + 2], body[JOINTS * leg + 3]
        R_WF, R_WS = rotation_matrix(femur[3:7]), rotation_matrix(tibia[3:7])
        com_S, tip_S = np.array(data.links[2].com), np.array(data.links[2].tip)
        points[leg, 0] = femur[0:3] - R_WF @ np.array(data.links[1].com)
        points[leg, 1] = tibia[0:3] - R_WS @ com_S
        points[leg, 2] = tibia[0:3] + R_WS @ (tip_S - com_S)
    return points


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


# femurs first; in the order of the C plant
PAIRS = tuple(Pair(leg, *lines) for lines in product(range(2), repeat=2) for leg in range(LEGS))


def leg_pairs(robot: Robot) -> tuple[Pair, ...]:
    """Returns all pairs; none unless body.self_contact is force."""
    return PAIRS if robot.body.self_contact == "force" else ()


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


def clearances(robot: Robot, body: Array) -> Array:
    """Returns the least distance (6,) [m] of each leg from its two neighbours around the torso.

    Femur and tibia are capsules of the knee's and the shank's radius; negative: they overlap.
    """
    points, found = leg_points(robot, body), np.full(LEGS, np.inf)
    for pair in PAIRS:
        legs = [pair.leg, NEXT[pair.leg]]
        gap = -pair_contact(robot, body, points, pair).penetration
        found[legs] = np.minimum(found[legs], gap)
    return found


def open_body_contact(robot: Robot) -> ContactState:
    """Returns an open contact of others than soles: the robot's laws without bristles and soil.

    The tanh law (eq. 35) takes the place of bristles.
    """
    friction = robot.friction
    if friction.has_bristles:
        friction = replace(friction, law="tanh")
    return ContactState(robot.contact, friction, Soil())


def standing_pairs(robot: Robot, body: Array) -> tuple[ContactState, ...]:
    """Returns the contacts between legs of bodies (19, 13): those that overlap are closed, with
    impact speed 0.
    """
    state = open_body_contact(robot)
    closed = replace(state, damping=contact_damping(robot.contact, 0.0))
    found = pair_contacts(robot, body)
    return tuple(closed if contact.penetration > 0.0 else state for contact in found)
