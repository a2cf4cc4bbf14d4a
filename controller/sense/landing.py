"""Predicts the height above the end of its path at which each foot meets the ground (C35).

C: landing.h. On level ground with the torso as planned this height is 0. A torso that sags or
leans, or ground that yields, lets all feet meet the ground early at every step; a bump lets one
foot meet it early once. The expected height of a foot is therefore the least height at which
another foot last met the ground, or to which it has come down in its swing without contact. It is
the foot's own height of the step before, if that is larger.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask
from hexapod_cosim.controller.sense.touchdown import EARLY


def _least_of_others(values: Array) -> Array:
    """Returns for each foot the least value of the other five (6,); 0 where it is infinite."""
    first, second = np.sort(values)[:2]
    least = np.where(np.arange(LEGS) == values.argmin(), second, first)
    return np.where(np.isfinite(least), least, 0.0)


class Landings(Stateful):
    """Heights of the last landings of all feet.

    Attributes, (6,) each:
        met: height of the path above its end at the last landing [m]; inf before the first one.
        before: the same at the landing before that [m]; 0 before there was one.
        flew: the foot has left the ground since its last landing.
    """

    STATE = ("met", "before", "flew")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Removes all recorded landings."""
        self.met, self.before = np.full(LEGS, math.inf), np.zeros(LEGS)
        self.flew: Mask = np.zeros(LEGS, dtype=np.bool_)

    def look(self, touching: Mask, height: Array, swinging: Mask) -> None:
        """Records the landings of this period.

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
        """Returns the heights (6,) at which the feet are expected to meet the ground [m] (C35).

        They are 0 before the first landing. Arguments are those of look().
        """
        known = np.where(swinging & ~touching, np.maximum(height, 0.0), self.met)
        return np.maximum(_least_of_others(known), self.before)

    def early(self, expected: Array, height: Array) -> Mask:
        """Returns the feet (6,) that met the ground early (C36).

        Their paths are still above the heights of earlier landings.

        expected: (6,) from expected() [m]; height: (6,) of the paths over their ends [m].
        """
        settled = np.maximum(_least_of_others(self.met), self.before)
        return (self.met > expected + EARLY) & (height > settled + EARLY)
