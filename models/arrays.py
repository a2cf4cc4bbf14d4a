"""Names of the types of arrays and tuples, and the check of arrays that callers give."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models.errors import HexapodError

Array = NDArray[np.float64]
Vector3 = tuple[float, float, float]
Vector6 = tuple[float, float, float, float, float, float]


def array_of(value: Any, shape: tuple[int, ...], *, where: str) -> Array:
    """Returns an argument as an array. Raises HexapodError unless it has numbers and the shape."""
    got = value
    with suppress(TypeError, ValueError):
        array = np.asarray(value, dtype=np.float64)
        if array.shape == shape:
            return array
        got = f"shape {array.shape}" if array.ndim else value
    expected = f"an array of numbers of the shape {shape}"
    raise HexapodError("wrong type of an argument", got=str(got), expected=expected, where=where)
