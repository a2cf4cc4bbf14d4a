"""Converts vectors between torso frame and walking frame (C10). C: posture.h.

The walking frame K is the torso frame of a robot at its nominal height and level posture. The torso
frame T is above it by a height and turned by R_KT, roll about x first and then pitch about y.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hexapod_cosim.controller.plane import Array
from hexapod_cosim.controller.walk.kinematics import Feet


class Posture(NamedTuple):
    """Height and attitude of the torso in the walking frame, and their rates."""

    level: bool  # height, roll, pitch and their rates are all 0: the frames coincide
    height: float  # m
    R_KT: Array  # 1    (3, 3)
    rate: float  # m/s    of the height
    w_KT: tuple[float, float, float]  # rad/s    of the torso, its axes

    @classmethod
    def of(cls, value: Array, rate: Array) -> Posture:
        """Returns the posture for height, roll and pitch (3,) [m, rad, rad] and their rates.

        rate: (3,) per second.
        """
        height, roll, pitch = value.tolist()
        height_rate, roll_rate, pitch_rate = rate.tolist()
        if not any((height, roll, pitch, height_rate, roll_rate, pitch_rate)):
            return LEVEL
        cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
        R_KT = np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])
        w_KT = (roll_rate, pitch_rate * cr, -pitch_rate * sr)
        return cls(False, height, R_KT, height_rate, w_KT)

    def turn(self, plane: Any, z: Any) -> tuple[Any, Any]:
        """Returns R_KT p of vectors p = (x + i y, z) of any shape: torso axes to walking axes."""
        return (plane, z) if self.level else _product(self.R_KT, plane, z)

    def turn_back(self, plane: Any, z: Any) -> tuple[Any, Any]:
        """Returns R_TK p of vectors p = (x + i y, z) of any shape: walking axes to torso axes."""
        return (plane, z) if self.level else _product(self.R_KT.T, plane, z)

    def to_torso(self, plane: Any, height: Any) -> tuple[Any, Any]:
        """Converts points (x + i y, z) [m] from the walking frame to the torso frame."""
        # p_T = R_TK (p_K - height e_z)
        return (plane, height) if self.level else self.turn_back(plane, height - self.height)

    def feet_to_torso(self, feet: Feet) -> Feet:
        """Converts positions and velocities of feet from the walking frame to the torso frame."""
        if self.level:
            return feet
        x, y, z = self.w_KT
        plane, height = self.to_torso(feet.plane, feet.height)
        # v_T = R_TK (v_K - rate e_z) - w_KT x p_T
        velocity, rise = self.turn_back(feet.velocity, feet.rise - self.rate)
        velocity = velocity - ((y - 1j * x) * height + 1j * z * plane)
        rise = rise - (x * plane.imag - y * plane.real)
        return Feet(plane, height, velocity, rise)


LEVEL = Posture(True, 0.0, np.eye(3), 0.0, (0.0, 0.0, 0.0))


def _product(rotation: Array, plane: Any, z: Any) -> tuple[Any, Any]:
    x, y = plane.real, plane.imag
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    turned = (xx * x + xy * y + xz * z) + 1j * (yx * x + yy * y + yz * z)
    return turned, zx * x + zy * y + zz * z
