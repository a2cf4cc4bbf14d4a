"""Computes the centres of the feet in the torso's frame: what plans of feet are compared with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import joint_names, vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

Array = NDArray[np.float64]


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
        tip = [parameters[f"{link}.{key}"] for key in ("length", "offset_y", "offset_z")]
        axis = np.array([parameters[key] for key in vector_names(f"{link}.axis")])
        place = turned(place + np.array(tip), axis / np.linalg.norm(axis), angle[:, joint])
    yaw = np.full(len(angle), parameters[f"{leg}.hip_yaw"])
    hip = np.array([parameters[key] for key in vector_names(f"{leg}.hip_position")])
    return np.asarray(hip + turned(place, np.array([0.0, 0.0, 1.0]), yaw))


def turned(vector: Array, axis: Array, angle: Array) -> Array:
    """Returns vectors (rows, 3) turned about a unit axis (3,) by angles (rows,) [rad]."""
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along = (vector @ axis)[:, None] * axis
    return np.asarray(along + cosine * (vector - along) + sine * np.cross(axis, vector))
