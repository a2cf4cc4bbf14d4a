"""Kinematics of the legs from joint angles: centres of the feet, which plans are compared with, and
first moments of mass.
"""

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
