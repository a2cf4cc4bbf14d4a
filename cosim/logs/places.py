"""Finds the places of the robot's frames in a recording."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models.kinematics import rotation_matrix

Array = NDArray[np.float64]


def torso_places(recording: Recording, com: Array) -> Array:
    """Returns the positions (rows, 3) of the origin of the torso's frame in the world [m].

    com: centre of mass in that frame (3,) [m].
    """
    positions = recording.columns(vector_names("torso.position"))
    if not com.any():
        return positions
    turns = recording.columns(vector_names("torso.quaternion", 4))
    return np.asarray(positions - np.array([rotation_matrix(turn) @ com for turn in turns]))
