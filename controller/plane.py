"""Represents vectors of a plane as complex numbers x + i y. C: plane.h.

A rotation is then one product. Horizontal vectors are x + i y, vectors in the vertical plane of a
leg u + i w (outward and up).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models import LEG_NAMES

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Plane = NDArray[np.complex128]  # points or directions x + i y

LEGS = len(LEG_NAMES)


def along(a: Any, b: Any) -> Any:
    """Returns Re(a^* b), the dot product of two vectors of a plane."""
    return a.real * b.real + a.imag * b.imag


def across(a: Any, b: Any) -> Any:
    """Returns Im(a^* b), the cross product of two vectors of a plane."""
    return a.real * b.imag - a.imag * b.real


def square(a: Any) -> Any:
    """Returns the squared length of a vector of a plane."""
    return a.real * a.real + a.imag * a.imag


def cis(angle: Any) -> Any:
    """Returns e^(i angle) of an angle [rad], a number or an array."""
    if isinstance(angle, float):
        return complex(math.cos(angle), math.sin(angle))
    return plane_of(np.cos(angle), np.sin(angle))


def plane_of(x: Array, y: Any) -> Plane:
    """Returns x + i y of an array x and an array of its shape, or a number, y."""
    plane = np.empty(x.shape, dtype=np.complex128)
    plane.real, plane.imag = x, y
    return plane


def some(values: Array | Mask) -> bool:
    """Returns whether some value is not 0; on small arrays faster than values.any()."""
    return bool(np.count_nonzero(values))


def rows_of(x: Array, y: Array, z: Array) -> Array:
    """Returns the rows x y z (6, 3) of three arrays (6,)."""
    return np.array((x, y, z)).T


def clamp(x: Any, low: Any, high: Any) -> Any:
    """Returns the numbers x, limited to [low, high]."""
    return np.minimum(np.maximum(x, low), high)
