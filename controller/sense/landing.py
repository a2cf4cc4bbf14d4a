"""How high above the ends of their paths the feet meet the ground (C35). C: landing.c.

On level ground under a torso that lies as planned that is 0. A torso that sags or leans, or feet
that sink in, let all feet meet the ground early, step after step; a bump lets one foot meet it
early, once. So a foot is expected to meet the ground at the least height at which the other feet
have met it last, or which they have reached in their swing without meeting it; or as high as it did
itself a step before.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask
from hexapod_cosim.controller.sense.touchdown import EARLY


def _least_of_others(values: Array) -> Array:
    """(6,) the least of the other five values; 0 where that is infinite."""
    first, second = np.sort(values)[:2]
    least = np.where(np.arange(LEGS) == values.argmin(), second, first)
    return np.where(np.isfinite(least), least, 0.0)


class Landings(Stateful):
    """The last landings of all feet.

    Attributes, (6,) each:
        met: height of the path over its end when the foot last came down [m]; inf until it has.
        before: the same at the landing before that [m]; 0 until there was one.
        flew: the foot has been off the ground in a swing since.
    """

    STATE = ("met", "before", "flew")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """No foot has come down yet."""
        self.met, self.before = np.full(LEGS, math.inf), np.zeros(LEGS)
        self.flew: Mask = np.zeros(LEGS, dtype=np.bool_)

    def look(self, touching: Mask, height: Array, swinging: Mask) -> None:
        """One period on.

        Args:
            touching: (6,) feet that report a force.
            height: (6,) of the paths over their ends [m].
            swinging: (6,) legs planned in the air.
        """
        landed = touching & self.flew
        if landed.any():
            self.before = np.where(landed & np.isfinite(self.met), self.met, self.before)
            now = np.where(swinging, np.maximum(height, 0.0), 0.0)
            self.met = np.where(landed, now, self.met)
        self.flew = (self.flew | swinging) & ~touching

    def expected(self, touching: Mask, height: Array, swinging: Mask) -> Array:
        """Where each foot meets the ground without any bump (C35), (6,) [m].

        It is 0 while nothing tells. Arguments are those of look().
        """
        told = np.where(swinging & ~touching, np.maximum(height, 0.0), self.met)
        return np.maximum(_least_of_others(told), self.before)

    def early(self, expected: Array, height: Array) -> Mask:
        """(6,) feet that met the ground early and are still above where feet met it before (C36).

        expected: (6,) from expected() [m]; height: (6,) of the paths over their ends [m].
        """
        settled = np.maximum(_least_of_others(self.met), self.before)
        return (self.met > expected + EARLY) & (height > settled + EARLY)
