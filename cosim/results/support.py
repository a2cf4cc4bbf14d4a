"""Computes from joint angles where feet and centre of mass are, and the stability margin: the
centre of mass over the support polygon of the standing feet.

All rows of a recording are computed at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, TERRAINS
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import unit_rotation

Mask = NDArray[np.bool_]
ROWS_AT_ONCE = 4096  # bounds the memory of the pairs of feet
COINCIDENT = 1e-9  # m    feet closer than this make no edge
# numbers of the FMU's enumerations
FLAT, SLOPE, GRID = (TERRAINS.index(kind) + 1 for kind in ("flat", "slope", "grid"))


def stability_margins(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns the distance [m] of the projected centre of mass from the support polygon's edge.

    One value per row (rows,); the projection is along gravity. Negative outside the polygon, and
    for two feet, whose polygon is a line; NaN with fewer than two feet on the ground.
    """
    plane = _plane_axes(np.array([parameters[name] for name in vector_names("gravity")]))
    positions = recording.foot_vectors("position").transpose(1, 2, 0)
    feet = np.ascontiguousarray(plane @ positions)  # (6, 2, rows)
    centre = plane @ centre_of_mass(recording, parameters).T
    standing = recording.feet("contact") > 0.5
    parts = [slice(begin, begin + ROWS_AT_ONCE) for begin in range(0, len(standing), ROWS_AT_ONCE)]
    return np.concatenate(
        [polygon_margins(feet[..., part], standing[part], centre[:, part]) for part in parts]
    )


def _plane_axes(gravity: Array) -> Array:
    """Returns two axes (2, 3) that make a right-handed frame with the upward direction.

    They are x and y where gravity is along -z.
    """
    up = -gravity / np.linalg.norm(gravity) if np.any(gravity) else np.array([0.0, 0.0, 1.0])
    x, y, _ = np.eye(3)
    first = x - up[0] * up if abs(up[0]) < 0.9 else y - up[1] * up
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first)])


def polygon_margins(feet: Array, standing: Mask, centre: Array) -> Array:
    """Returns the signed distances (rows,) of points (2, rows) from the hulls of standing feet.

    feet: (6, 2, rows) positions; standing: (rows, 6). Positive inside the hull.
    """
    margin = np.full(len(standing), np.nan)
    codes = standing @ (1 << np.arange(standing.shape[1]))  # one bit per leg
    for pattern in np.flatnonzero(np.bincount(codes)).tolist():
        legs = [leg for leg in range(standing.shape[1]) if pattern >> leg & 1]
        if len(legs) > 1:
            rows = np.flatnonzero(codes == pattern)
            margin[rows] = _hull_margins(feet[legs].take(rows, axis=2), centre.take(rows, axis=1))
    return margin


def _hull_margins(feet: Array, centre: Array) -> Array:
    """Returns what polygon_margins() does, for feet (n, 2, rows) that all stand."""
    first, last = np.array(list(combinations(range(len(feet)), 2))).T
    begin = feet[first]  # (pairs, 2, rows)
    edge = feet[last] - begin
    length = np.sqrt(edge[:, 0] * edge[:, 0] + edge[:, 1] * edge[:, 1])
    shown = np.maximum(length, COINCIDENT)
    x, y = -edge[:, 1] / shown, edge[:, 0] / shown  # to the edge's left
    offset = x * begin[:, 0] + y * begin[:, 1]
    # largest distances of the feet to either side of the edge
    right, left = np.zeros_like(x), np.zeros_like(x)
    for foot_x, foot_y in feet:
        beside = x * foot_x + y * foot_y - offset
        np.minimum(right, beside, out=right)
        np.maximum(left, beside, out=left)
    inside = x * centre[0] + y * centre[1] - offset
    # an edge belongs to the hull, seen from the side where all feet are; for two feet, from both
    margin = np.minimum(
        np.where(right >= -COINCIDENT, inside, np.inf),
        np.where(left <= COINCIDENT, -inside, np.inf),
    )
    margin = np.where(length > COINCIDENT, margin, np.inf).min(axis=0)
    return np.where(np.isfinite(margin), margin, np.nan)


def centre_of_mass(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns the centre of mass of the whole robot [m] (rows, 3), world axes.

    It follows from joint angles, torso pose and the FMU's parameters.
    """
    angle = recording.columns(joint_names("angle")).reshape(-1, len(LEG_NAMES), len(JOINT_NAMES))
    com = np.array([parameters[name] for name in vector_names("torso.com")])
    mass = parameters["torso.mass"]
    moment = np.broadcast_to(mass * com, (len(angle), 3))  # kg m    in the torso's frame
    for k, leg in enumerate(LEG_NAMES):
        own, first = moment_of_leg(leg, angle[:, k], parameters)
        mass, moment = mass + own, moment + first
    offset = moment / mass - com  # from the torso's centre of mass
    R_WT = rotation_matrices(recording.vector("torso.quaternion", 4))
    return np.asarray(recording.vector("torso.position") + np.einsum("ijr,rj->ri", R_WT, offset))


def rotation_matrices(quaternion: Array) -> Array:
    """Returns rotations from body to world (3, 3, rows) from quaternions (rows, 4) [w x y z]."""
    return unit_rotation(*np.ascontiguousarray(quaternion.T))


def feet_of_angles(part: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns the centres of the feet in the torso's frame [m] (rows, 6, 3) from joint angles.

    They do not depend on the ground. parameters: of the FMU, with the geometry of the legs.
    """
    angle = part.columns(joint_names("angle")).reshape(-1, len(LEG_NAMES), len(JOINT_NAMES))
    legs = [_centre(leg, angle[:, k], parameters) for k, leg in enumerate(LEG_NAMES)]
    return np.stack(legs, axis=1)


def _centre(leg: str, angle: Array, parameters: Mapping[str, float]) -> Array:
    """Returns the centre of one foot (rows, 3), by angles (rows, 3) of its joints [rad]."""
    place = np.zeros((len(angle), 3))
    for joint, name in reversed(list(enumerate(JOINT_NAMES))):
        link = f"{leg}.{name}"
        place = turned(place + _tip(link, parameters), _axis(link, parameters), angle[:, joint])
    return _hip(leg, parameters) + _turned_by_hip(leg, place, parameters)


def moment_of_leg(leg: str, angle: Array, parameters: Mapping[str, float]) -> tuple[float, Array]:
    """Returns the mass of a leg [kg] and its first moment [kg m] (rows, 3) in the torso's frame.

    angle: (rows, 3) of its joints [rad].
    """
    borne, moment = 0.0, np.zeros((len(angle), 3))  # of the links from this joint on, about it
    for joint, name in reversed(list(enumerate(JOINT_NAMES))):
        link = f"{leg}.{name}"
        mass = parameters[f"{link}.mass"]
        com = np.array([parameters[key] for key in vector_names(f"{link}.com")])
        moment = moment + mass * com + borne * _tip(link, parameters)
        moment = turned(moment, _axis(link, parameters), angle[:, joint])
        borne += mass
    return borne, borne * _hip(leg, parameters) + _turned_by_hip(leg, moment, parameters)


def _tip(link: str, parameters: Mapping[str, float]) -> Array:
    return np.array([parameters[f"{link}.{key}"] for key in ("length", "offset_y", "offset_z")])


def _axis(link: str, parameters: Mapping[str, float]) -> Array:
    axis = np.array([parameters[key] for key in vector_names(f"{link}.axis")])
    return np.asarray(axis / np.linalg.norm(axis))


def _hip(leg: str, parameters: Mapping[str, float]) -> Array:
    return np.array([parameters[key] for key in vector_names(f"{leg}.hip_position")])


def _turned_by_hip(leg: str, vector: Array, parameters: Mapping[str, float]) -> Array:
    yaw = np.full(len(vector), parameters[f"{leg}.hip_yaw"])
    return turned(vector, np.array([0.0, 0.0, 1.0]), yaw)


def turned(vector: Array, axis: Array, angle: Array) -> Array:
    """Returns vectors (rows, 3) turned about a unit axis (3,) by angles (rows,) [rad]."""
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along = (vector @ axis)[:, None] * axis
    return np.asarray(along + cosine * (vector - along) + sine * np.cross(axis, vector))


def body_height(part: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns the height of the torso above the ground along z [m] (rows,).

    The ground of a surface is the mean height of the feet in contact, of the last ones while there
    are none. Its height below the torso would jump at each stone and gap.
    """
    x, y, z = part.vector("torso.position").T
    if parameters.get("terrain.kind", FLAT) == GRID:
        return np.asarray(z - _feet_level(part, parameters))
    heading = parameters.get("terrain.heading", 0.0)
    rise = x * np.cos(heading) + y * np.sin(heading)
    ground: Array = parameters.get("terrain.height", 0.0) + np.tan(_incline(parameters)) * rise
    return np.asarray(z - ground)


def _feet_level(part: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns the mean height of the contact points of feet in contact [m] (rows,).

    Rows without a contact have the value of the last row with one; before the first contact it is
    `terrain.height`.
    """
    in_contact = part.feet("contact") > 0.5
    count = in_contact.sum(axis=1)
    height = np.where(in_contact, part.foot_vectors("position")[:, :, 2], 0.0).sum(axis=1)
    level = height / np.maximum(count, 1)
    latest = np.maximum.accumulate(np.where(count > 0, np.arange(len(count)), -1))
    before = parameters.get("terrain.height", 0.0)
    return np.where(latest >= 0, level[np.maximum(latest, 0)], before)


def ground_normal(parameters: Mapping[str, float]) -> Array:
    """Returns the ground's upward normal (3,), world axes; that of a surface is the vertical."""
    heading, incline = parameters.get("terrain.heading", 0.0), _incline(parameters)
    sine = np.sin(incline)
    return np.array([-sine * np.cos(heading), -sine * np.sin(heading), np.cos(incline)])


def _incline(parameters: Mapping[str, float]) -> float:
    """Returns the incline of the ground [rad], which is 0 for all but slopes."""
    slope = parameters.get("terrain.kind", FLAT) == SLOPE
    return float(parameters.get("terrain.incline", 0.0)) if slope else 0.0


def real_feet(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """Returns the centres of the feet in the torso's frame [m] (rows, 6, 3).

    On a plane they are a radius above the contact points, along the normal. On a surface, whose
    normal depends on the place, they follow from the joint angles.
    """
    if parameters.get("terrain.kind", FLAT) == GRID:
        return feet_of_angles(recording, parameters)
    R_WT = rotation_matrices(recording.vector("torso.quaternion", 4))
    centres = recording.foot_vectors("position") + parameters["foot.radius"] * ground_normal(
        parameters
    )
    arms = centres - recording.vector("torso.position")[:, None, :]
    com = np.array([parameters[name] for name in vector_names("torso.com")])
    along = arms.transpose(2, 1, 0)  # (3, 6, rows)
    seen = [
        R_WT[0, i] * along[0] + R_WT[1, i] * along[1] + R_WT[2, i] * along[2] + com[i]
        for i in range(3)
    ]
    return np.array(seen).transpose(2, 1, 0)
