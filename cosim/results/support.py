"""Computes the stability margin: the centre of mass over the support polygon of the standing feet.

All rows of a recording are computed at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.feet import moment_of_leg
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
ROWS_AT_ONCE = 4096  # bounds the memory of the pairs of feet
COINCIDENT = 1e-9  # m    feet closer than this make no edge


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
    rotation = rotation_matrices(recording.vector("torso.quaternion", 4))
    return np.asarray(
        recording.vector("torso.position") + np.einsum("ijr,rj->ri", rotation, offset)
    )


def rotation_matrices(quaternion: Array) -> Array:
    """Returns rotations from body to world (3, 3, rows) from quaternions (rows, 4) [w x y z]."""
    w, x, y, z = np.ascontiguousarray(quaternion.T)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows)
