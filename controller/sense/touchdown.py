"""Ground that is met too early or too late (C36). C: touchdown.c.

A foot that meets the ground before its path ends is not pressed into it: it keeps the height at
which it touched, through its stance. A foot that finds no ground where its path ends reaches down
for it, at a fixed speed and down to a limit. What either has added to the path vanishes in the next
swing.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask

EARLY = 0.002  # m    a foot that meets the ground with more of its way down to go has met it early
REACH_SPEED = 0.08  # m/s    downwards
REACH_LIMIT = 0.020  # m
HOLD_LIMIT = 0.030  # m    upwards: as high as a swing of the robots goes
GRACE = 0.040  # s    after the planned touch-down, in which a foot may be late
RETURN_TIME = 0.060  # s    time constant with which an offset vanishes in the swing
NEGLIGIBLE = 1e-5  # m    an offset less than this is none


class Touchdown(Stateful):
    """Offsets of all feet.

    Attributes, (6,) each:
        offset: by which the paths are raised [m].
        late: for how long the ground has been missed [s].
    """

    STATE = ("offset", "late")

    def __init__(self, *, period: float) -> None:
        self.period = period
        self.reset()

    def reset(self) -> None:
        """Sets the height offsets of all feet to zero."""
        self.offset, self.late = np.zeros((2, LEGS))

    def busy(self) -> bool:
        """Whether some foot has an offset or misses the ground."""
        return bool(self.offset.any() or self.late.any())

    def _moved(self, touching: Mask, falling: Array, swinging: Mask) -> Array:
        """(6,) the next offsets [m]. Arguments are those of step()."""
        reached = np.maximum(self.offset - REACH_SPEED * self.period, -REACH_LIMIT)
        held = np.minimum(self.offset + falling, HOLD_LIMIT)
        faded = self.offset * math.exp(-self.period / RETURN_TIME)
        faded = np.where(np.abs(self.offset) > NEGLIGIBLE, faded, 0.0)
        in_swing = np.where(touching, np.where(falling > 0.0, held, self.offset), faded)
        moved = np.where(swinging, in_swing, self.offset)
        return np.where(self.late > GRACE, reached, moved)

    def step(self, touching: Mask, falling: Array, swinging: Mask, loaded: Mask) -> None:
        """One period on (C36).

        Args:
            touching: (6,) feet that report a force.
            falling: (6,) how far the path of a foot that met the ground early comes down in this
                period [m], 0 of the others.
            swinging: (6,) legs planned in the air.
            loaded: (6,) legs planned to carry their whole share.
        """
        self.late = np.where(loaded & ~touching, self.late + self.period, 0.0)
        self.offset = self._moved(touching, falling, swinging)
