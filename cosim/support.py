"""How far the robot is from tipping: its centre of mass over the polygon of its standing feet, for all rows of a recording at once."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.recorder import Recording
from hexapod_cosim.cosim.signals import vector_names
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
PAIRS = np.array(list(permutations(range(len(LEG_NAMES)), 2)))  # (30, 2) directed edges between feet
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
    begin, end = feet[:, PAIRS[:, 0]], feet[:, PAIRS[:, 1]]
    edge = end - begin  # (rows, 30, 2)
    length = np.linalg.norm(edge, axis=-1)
    left = np.stack([-edge[..., 1], edge[..., 0]], axis=-1) / np.maximum(length, COINCIDENT)[..., None]
    # a directed edge is one of the hull's when no standing foot lies to its right
    beside = np.einsum("rek,refk->ref", left, feet[:, None] - begin[:, :, None])  # (rows, 30, 6)
    clear = np.where(standing[:, None], beside, 0.0).min(axis=-1) >= -COINCIDENT
    hull = clear & standing[:, PAIRS[:, 0]] & standing[:, PAIRS[:, 1]] & (length > COINCIDENT)
    distance = np.einsum("rek,rek->re", left, centre[:, None] - begin)
    margin = np.where(hull, distance, np.inf).min(axis=-1)
    return np.where(np.isfinite(margin), margin, np.nan)


def centre_of_mass(recording: Recording, parameters: Mapping[str, float]) -> Array:
    """(rows, 3) centre of mass of the whole robot [m], world axes, from joint angles, torso pose and the FMU's own parameters."""
    angle = recording.joints("angle")
    total, moment = parameters["torso.mass"], np.zeros((len(angle), 3))  # moment about the torso's centre of mass, torso axes
    offset = _vector(parameters, "torso.com")
    for number, leg in enumerate(LEG_NAMES):
        turned = np.broadcast_to(_about((0.0, 0.0, 1.0), np.array([parameters[f"{leg}.hip_yaw"]])), (len(angle), 3, 3))
        joint = np.broadcast_to(_vector(parameters, f"{leg}.hip_position") - offset, (len(angle), 3))
        for k, name in enumerate(JOINT_NAMES):
            link = f"{leg}.{name}"
            turned = turned @ _about(tuple(_vector(parameters, f"{link}.axis")), angle[:, number, k])
            mass = parameters[f"{link}.mass"]
            moment += mass * (joint + turned @ _vector(parameters, f"{link}.com"))
            total += mass
            joint = joint + turned @ np.array([parameters[f"{link}.{part}"] for part in ("length", "offset_y", "offset_z")])
    rotation = rotation_matrices(recording.vector("torso.quaternion", 4))
    offset_world: Array = np.einsum("rij,rj->ri", rotation, moment / total)
    return recording.vector("torso.position") + offset_world


def _vector(parameters: Mapping[str, float], stem: str) -> Array:
    return np.array([parameters[name] for name in vector_names(stem)])


def _about(axis: tuple[float, ...], angle: Array) -> Array:
    """(rows, 3, 3) rotations about an axis by angles (rows,): Rodrigues."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Array = np.eye(3) + np.sin(angle)[:, None, None] * skew + (1.0 - np.cos(angle))[:, None, None] * (skew @ skew)
    return turn


def rotation_matrices(quaternion: Array) -> Array:
    """(rows, 3, 3) body to world from quaternions (rows, 4) w x y z."""
    w, x, y, z = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
