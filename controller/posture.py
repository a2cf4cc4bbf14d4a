"""Height, roll and pitch of the torso over its feet: from the walking frame to the torso frame.

    p_T = R_TK (p_K - height e_z)        v_T = R_TK (v_K - rate e_z) - w_T x p_T

Both are one product of the foot's row (x y vx vy z vz) with a matrix, and these are known as soon as the command is.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.kinematics import LEGS, Array, Feet

POSITION, VELOCITY = [0, 1, 4], [2, 3, 5]  # of a row: so that x y and vx vy are complex numbers


class Posture:
    """Postures of successive steps. Attribute `rotation`: (n, 3, 3) R_KT, torso to walking frame."""

    def __init__(self, value: Array, rate: Array) -> None:
        """(n, 3) each: height [m], roll, pitch [rad], and their rates per second."""
        count, height = len(value), np.zeros((len(value), 6))
        self.rotation = rotations(value[:, 1], value[:, 2])
        self._matrix = np.zeros((count, 6, 6))  # from the left: columns are results
        spin = _spins(value[:, 1], rate[:, 1], rate[:, 2])
        self._matrix[np.ix_(range(count), POSITION, POSITION)] = self._matrix[np.ix_(range(count), VELOCITY, VELOCITY)] = self.rotation
        self._matrix[np.ix_(range(count), POSITION, VELOCITY)] = self.rotation @ spin
        height[:, 4], height[:, 5] = value[:, 0], rate[:, 0]
        self._offset = np.einsum("ni,nij->nj", height, self._matrix)
        self._feet, self._turned = np.empty((2, LEGS, 6))
        self._points, self._turned_points = self._feet[:, :4].view(np.complex128), self._turned[:, :4].view(np.complex128)

    def apply(self, at: int, feet: Feet) -> Feet:
        """Feet of a step in the torso frame."""
        points, rows = self._points, self._feet
        points[:, 0], rows[:, 4], points[:, 1], rows[:, 5] = feet
        np.dot(rows, self._matrix[at], out=self._turned)
        np.subtract(self._turned, self._offset[at], out=self._turned)
        (plane, velocity), (height, rise) = self._turned_points.T.tolist(), self._turned[:, 4:].T.tolist()
        return plane, height, velocity, rise


def rotations(roll: Array, pitch: Array) -> Array:
    """(n, 3, 3) R_KT, roll about x first, then pitch about y; both (n,) [rad]."""
    cr, sr, cp, sp, zero = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.zeros_like(roll)
    return np.array([[cp, sp * sr, sp * cr], [zero, cr, -sr], [-sp, cp * sr, cp * cr]]).transpose(2, 0, 1)


def _spins(roll: Array, roll_rate: Array, pitch_rate: Array) -> Array:
    """(n, 3, 3) matrix [w] of the torso's angular velocity in its own axes: for columns [w] p = w x p, so for rows p [w] = -w x p."""
    x, y, z = roll_rate, pitch_rate * np.cos(roll), -pitch_rate * np.sin(roll)
    zero = np.zeros_like(x)
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
