"""Height, roll and pitch of the torso over its feet: from the walking frame K to the torso frame T.

p_T = R_TK (p_K - height e_z)        v_T = R_TK (v_K - rate e_z) - w_T x p_T
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.kinematics import Array, Feet, Plane


def in_torso_frame(feet: Feet, value: Array, rate: Array) -> Feet:
    """Feet of the walking frame under a torso at (n, 3) height [m], roll, pitch [rad], with
    their rates per second.
    """
    back = rotations(value[:, 1], value[:, 2]).transpose(0, 2, 1)
    plane, height = turned(feet.plane, feet.height - value[:, :1], back)
    velocity, rise = turned(feet.velocity, feet.rise - rate[:, :1], back)
    x, y, z = _spins(value[:, 1], rate[:, 1], rate[:, 2])[..., None]
    # w x p
    return Feet(
        plane,
        height,
        velocity - (y - 1j * x) * height - 1j * z * plane,
        rise - (x * plane.imag - y * plane.real),
    )


def rotations(roll: Array, pitch: Array) -> Array:
    """(n, 3, 3) R_KT, roll about x first, then pitch about y; both (n,) [rad]."""
    cr, sr, cp, sp, zero = (
        np.cos(roll),
        np.sin(roll),
        np.cos(pitch),
        np.sin(pitch),
        np.zeros_like(roll),
    )
    return np.array([[cp, sp * sr, sp * cr], [zero, cr, -sr], [-sp, cp * sr, cp * cr]]).transpose(
        2, 0, 1
    )


def turned(plane: Plane, z: Array, rotation: Array) -> tuple[Plane, Array]:
    """Vectors (..., n, m), x + i y and z, turned by (n, 3, 3); or (m,) by (3, 3)."""
    vectors = np.stack([plane.real, plane.imag, z], axis=-1) @ rotation.swapaxes(-1, -2)
    return vectors[..., 0] + 1j * vectors[..., 1], vectors[..., 2]


def _spins(roll: Array, roll_rate: Array, pitch_rate: Array) -> Array:
    """(3, n) the torso's angular velocity in its own axes [rad/s]."""
    return np.stack([roll_rate, pitch_rate * np.cos(roll), -pitch_rate * np.sin(roll)])
