"""How high above the ends of their paths feet meet the ground.

On level ground under a torso that lies as planned that is 0. A torso that sags or leans, or feet
that sink in, let all feet meet the ground early, step after step; a bump lets one, once. So a foot
is expected to meet the ground at the least height at which the others have met it of late, or which
they have reached in their swing without meeting it; or as high as it did itself a step before.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hexapod_cosim.controller.kinematics import LEGS, Array, Mask
from hexapod_cosim.controller.touchdown import EARLY


class Landings:
    """Of all feet. `met`, `before`: (6,) height of each foot's path over its end when it last came
    down, and the time before that [m]; inf and 0 until it first has.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """No foot has come down yet."""
        self.restore((np.full(LEGS, math.inf), np.zeros(LEGS), np.zeros(LEGS, dtype=np.bool_)))

    def save(self) -> tuple[Any, ...]:
        """Returns the state that restore() takes."""
        return self.met, self.before, self._flew

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restores a state returned by save()."""
        self.met, self.before, self._flew = state

    def look(self, touching: Mask, height: Array, swinging: Mask) -> None:
        """One period on; (6,) each: feet that report a force, paths over their ends [m],
        swinging legs.
        """
        landed = touching & self._flew
        if landed.any():
            self.before = np.where(landed & (self.met < math.inf), self.met, self.before)
            self.met = np.where(landed, np.where(swinging, np.maximum(height, 0.0), 0.0), self.met)
        self._flew = (self._flew | swinging) & ~touching

    def expected(self, touching: Mask, height: Array, swinging: Mask) -> Array:
        """(6,) m    where each foot meets the ground without any bump; 0 while nothing tells"""
        return np.asarray(
            np.maximum(
                _least_of_others(np.where(swinging & ~touching, np.maximum(height, 0.0), self.met)),
                self.before,
            )
        )

    def early(self, expected: Array, height: Array) -> Mask:
        """(6,) feet that met the ground well above the height expected and have yet to come down to
        where feet met it before.
        """
        settled = np.maximum(_least_of_others(self.met), self.before)
        return np.asarray((self.met > expected + EARLY) & (height > settled + EARLY))


def _least_of_others(values: Array) -> Array:
    """(6,) the least of the other five; 0 where that is infinite."""
    first, second = np.sort(values)[:2]
    least = np.where(np.arange(LEGS) == values.argmin(), second, first)
    return np.where(least < math.inf, least, 0.0)
