"""How far the robot is from tipping: its centre of mass over the polygon of its standing feet, for all rows of a recording at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.recorder import Recording
from hexapod_cosim.cosim.signals import vector_names
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
ROWS_AT_ONCE = 4096  # bounds the memory of the pairs of feet
COINCIDENT = 1e-9  # m    feet closer than this make no edge


def stability_margins(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """(rows,) distance [m] of the centre of mass' projection along gravity from the support polygon's nearest edge.

    Negative outside, and for a line of two feet; NaN with fewer than two feet on the ground.
    """
    plane = _plane_axes(np.array([parameters[name] for name in vector_names("gravity")]))
    feet = recording.foot_vectors("position") @ plane.T
    centre = centre_of_mass(recording, parameters) @ plane.T
    standing = recording.feet("contact") > 0.5
    parts = [slice(begin, begin + ROWS_AT_ONCE) for begin in range(0, len(centre), ROWS_AT_ONCE)]
    return np.concatenate([polygon_margins(feet[part], standing[part], centre[part]) for part in parts])


def _plane_axes(gravity: Array) -> Array:
    """(2, 3) two axes that make a right-handed frame with the upward direction; x and y where gravity is along -z."""
    up = -gravity / np.linalg.norm(gravity) if np.any(gravity) else np.array([0.0, 0.0, 1.0])
    first = np.array([1.0, 0.0, 0.0]) - up[0] * up if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0]) - up[1] * up
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first)])


def polygon_margins(feet: Array, standing: Mask, centre: Array) -> Array:
    """Signed distances of points (rows, 2) from the convex hulls of the standing ones among feet (rows, 6, 2); positive inside."""
    margin = np.full(len(centre), np.nan)
    patterns, pattern_of = np.unique(standing @ (1 << np.arange(standing.shape[1])), return_inverse=True)
    for number, pattern in enumerate(patterns.tolist()):
        rows, legs = np.flatnonzero(pattern_of == number), [leg for leg in range(standing.shape[1]) if pattern >> leg & 1]
        if len(legs) > 1:
            margin[rows] = _hull_margins(feet[rows][:, legs].T, centre[rows].T)
    return margin


def _hull_margins(feet: Array, centre: Array) -> Array:
    """(rows,) the same for feet (2, n, rows) that all stand, and points (2, rows)."""
    pairs = np.array(list(permutations(range(feet.shape[1]), 2)))
    begin = feet[:, pairs[:, 0]]
    edge = feet[:, pairs[:, 1]] - begin  # (2, pairs, rows)
    length = np.sqrt(edge[0] * edge[0] + edge[1] * edge[1])
    left = np.stack([-edge[1], edge[0]]) / np.maximum(length, COINCIDENT)
    # a directed edge is one of the hull's when no foot lies to its right
    hull = length > COINCIDENT
    for foot in range(feet.shape[1]):
        hull &= _along(left, feet[:, foot, None] - begin) >= -COINCIDENT
    margin = np.where(hull, _along(left, centre[:, None] - begin), np.inf).min(axis=0)
    return np.where(np.isfinite(margin), margin, np.nan)


def _along(left: Array, way: Array) -> Array:
    """Scalar products of vectors (2, ...)."""
    return np.asarray(left[0] * way[0] + left[1] * way[1])


def centre_of_mass(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """(rows, 3) centre of mass of the whole robot [m], world axes, from joint angles, torso pose and the FMU's own parameters."""
    angle = recording.joints("angle").transpose(1, 2, 0)  # (6, 3, rows)
    borne, moment = np.zeros(len(LEG_NAMES)), np.zeros((len(LEG_NAMES), 3, 1))  # kg, kg m  of the links from here on, about their joint
    for k, joint in reversed(list(enumerate(JOINT_NAMES))):
        links = [f"{leg}.{joint}" for leg in LEG_NAMES]
        mass, com, axis = (_of_links(parameters, links, part) for part in (("mass",), vector_names("com"), vector_names("axis")))
        tip = _of_links(parameters, links, ("length", "offset_y", "offset_z"))
        moment = _turned(axis, angle[:, k], moment + (mass * com + borne[:, None] * tip)[..., None])
        borne = borne + mass[:, 0]
    hips = [f"{leg}.hip_position" for leg in LEG_NAMES]
    yaw, offset = np.array([parameters[f"{leg}.hip_yaw"] for leg in LEG_NAMES]), _vector(parameters, "torso.com")
    moment = _turned(np.tile([0.0, 0.0, 1.0], (len(LEG_NAMES), 1)), yaw[:, None], moment)
    from_torso = np.array([_vector(parameters, hip) - offset for hip in hips])
    total = parameters["torso.mass"] + borne.sum()
    own = (moment + (borne[:, None] * from_torso)[..., None]).sum(axis=0) / total  # (3, rows) torso axes, from its centre of mass
    rotation = rotation_matrices(recording.vector("torso.quaternion", 4))
    return np.asarray(recording.vector("torso.position") + np.einsum("rij,jr->ri", rotation, own))


def _of_links(parameters: Mapping[str, float], links: Sequence[str], parts: Sequence[str]) -> Array:
    """(links, parts)"""
    return np.array([[parameters[f"{link}.{part}"] for part in parts] for link in links])


def _turned(axis: Array, angle: Array, vector: Array) -> Array:
    """(legs, 3, rows) vectors turned about axes (legs, 3) by angles (legs, rows): Rodrigues."""
    x, y, z = (axis / np.linalg.norm(axis, axis=1, keepdims=True)).T
    zero = np.zeros_like(x)
    skew = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    across = skew @ vector
    return np.asarray(vector + np.sin(angle)[:, None] * across + (1.0 - np.cos(angle))[:, None] * (skew @ across))


def _vector(parameters: Mapping[str, float], stem: str) -> Array:
    return np.array([parameters[name] for name in vector_names(stem)])


def rotation_matrices(quaternion: Array) -> Array:
    """(rows, 3, 3) body to world from quaternions (rows, 4) w x y z."""
    w, x, y, z = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
