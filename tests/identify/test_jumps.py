"""Readings that jump with a number: differences over the jump are no derivatives, and the search
does not end at it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.fitting.differences import FINE, differences
from hexapod_cosim.extensions.identify.fitting.last_search import finished

Array = NDArray[np.float64]
READINGS, JUMPING = 60, slice(0, 6)


class Jumping:
    """Stands for a problem of two numbers whose first readings jump by 3 where z[0] is above 0.3.

    The optimum of the other readings is at (0.8, -0.4).
    """

    rows = (0, 1)

    def __init__(self) -> None:
        rng = np.random.default_rng(7)
        self.matrix = rng.normal(size=(READINGS, 2))
        self.right = self.matrix @ np.array([0.8, -0.4])
        self.counted = np.ones(READINGS, dtype=np.bool_)
        self.left = np.zeros(READINGS, dtype=np.bool_)

    def bounds(self) -> tuple[Array, Array]:
        return np.full(2, -8.0), np.full(2, 8.0)

    def predictions(self, z: Array) -> Array:
        found = self.matrix @ z
        found[JUMPING] += 3.0 * (z[0] > 0.3)
        return found

    def residuals(self, z: Array) -> Array:
        return np.where(self.counted, self.predictions(z) - self.right, 0.0)

    def jacobian(self, _z: Array, _slopes: Any) -> Array:
        return self.matrix * self.counted[:, None]

    def count_all(self) -> None:
        self.counted = np.ones(READINGS, dtype=np.bool_)

    def errors(self, _z: Array) -> list[Array]:
        return []

    def set_noise(self, _errors: list[Array]) -> None: ...

    def leave_out_bent(self, _z: Array) -> None:
        self.counted &= ~self.left

    def leave_out_nonlinear(self, change: Array, linear: Array) -> bool:
        jump = np.abs(change - linear) > 0.05
        new = bool(np.any(self.counted & jump))
        self.left |= jump
        self.counted &= ~jump
        return new


def test_the_search_passes_readings_that_jump() -> None:
    problem: Any = Jumping()
    start = np.array([0.2, 0.0])
    assert finished(problem, start, lambda _text: None) == pytest.approx([0.8, -0.4], abs=1e-9)
    assert np.flatnonzero(~problem.counted).tolist() == [0, 1, 2, 3, 4, 5]


def test_a_difference_over_a_jump_is_bent_and_one_of_a_curve_is_not() -> None:
    """Readings z, z^2 and z + (z > 0.005) at z = 0, moved by 0.01 to both sides. The slope of the
    second is that of one side, 0.01 off; that of the third is the one without the jump.
    """
    forth = np.array([0.01, 1e-4, 1.01])
    back = np.array([-0.01, 1e-4, -0.01])
    found = differences(np.zeros(1), FINE, [[(0.01, forth), (-0.01, back)]], [False], 3)
    assert found.bend == pytest.approx([0.0, 2e-4, 1.0], abs=1e-12)
    assert found.slopes[0][0] == pytest.approx([1.0, -0.01, 1.0], abs=1e-12)


def test_the_slope_by_a_delay_is_that_of_the_side_without_a_jump() -> None:
    forth, back = np.array([0.02, 5.02]), np.array([-3.02, -0.02])
    found = differences(np.zeros(1), FINE, [[(0.01, forth), (-0.01, back)]], [True], 2)
    assert found.slopes[0][0] == pytest.approx([2.0, 2.0], abs=1e-12)
    assert found.bend.tolist() == [0.0, 0.0]
