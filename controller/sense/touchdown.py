"""Corrects foot heights when the ground is met too early or too late (C35, C36). C: touchdown.h.

A foot that meets the ground before its path ends keeps the height of its contact through its
stance. A foot that finds no ground at the end of its path moves down at a fixed speed to a limit.
In the next swing these offsets decay.
A foot for which the gait clock waits reaches this speed slowly (C50): a force that is known late
must not let a foot that stands push the torso up.
A foot whose sensor has just been doubted follows its path until its next swing: what its sensor
said, or did not say, was the reason for its offset, which decays at once.

The ground is met early above the height at which it is expected (C35). On level ground with the
torso as planned this height is 0. A torso that sags or leans, or ground that yields, lets all feet
meet the ground early at every step; a bump lets one foot meet it early once. The expected height of
a foot is therefore the least height at which another foot last met the ground, or to which it has
come down in its swing without contact. It is the foot's own height of the step before, if that is
larger.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, some

EARLY = 0.002  # m    a contact more than this above the expected height is early
REACH_SPEED = 0.08  # m/s    downwards
REACH_LIMIT = 0.040  # m
HOLD_LIMIT = 0.030  # m    upwards: the robots' step height
GRACE = 0.040  # s    after the planned touch-down, in which a foot may be late
SEARCH_RAMP = 0.025  # s    of the gait clock, in which a foot that it waits for gains speed
RETURN_TIME = 0.060  # s    time constant with which an offset vanishes in the swing, or in doubt
NEGLIGIBLE = 1e-5  # m    a smaller offset is set to 0


class Touchdown(Stateful):
    """Height offsets of all feet.

    Attributes, (6,) each:
        offset: distance by which the path is raised [m].
        late: time without contact since the planned touch-down [s].
        waited: time for which the gait clock has waited for it [s].
    """

    STATE = ("offset", "late", "waited")

    def __init__(self, *, period: float) -> None:
        self.period = period
        self.reset()

    def reset(self) -> None:
        """Sets the height offsets of all feet to zero."""
        self.offset, self.late, self.waited = np.zeros((3, LEGS))

    def busy(self) -> bool:
        """Returns whether some foot has an offset or lacks its planned contact."""
        return some(self.offset) or some(self.late)

    def _faded(self) -> Array:
        """Returns the next offsets (6,) of feet that return to their paths [m]."""
        faded = self.offset * math.exp(-self.period / RETURN_TIME)
        return np.where(np.abs(self.offset) > NEGLIGIBLE, faded, 0.0)

    def _moved(self, contact: Mask, falling: Array, swinging: Mask, searching: Mask) -> Array:
        """Returns the next offsets (6,) [m]. Arguments are those of step()."""
        ramp = np.minimum(self.waited / SEARCH_RAMP, 1.0) ** 2
        pace = REACH_SPEED * np.where(self.late > GRACE, 1.0, ramp * ramp)
        reached = np.maximum(self.offset - pace * self.period, -REACH_LIMIT)
        raised = np.minimum(self.offset + falling, HOLD_LIMIT)
        in_swing = np.where(contact, np.where(falling > 0.0, raised, self.offset), self._faded())
        moved = np.where(swinging, in_swing, self.offset)
        return np.where(searching | (self.late > GRACE), reached, moved)

    def step(
        self,
        contact: Mask,
        falling: Array,
        swinging: Mask,
        loaded: Mask,
        searching: Mask,
        open_loop: Mask,
    ) -> None:
        """Advances the offsets by one period (C36).

        Args:
            contact: (6,) feet that report a force.
            falling: (6,) descent of the path in this period for feet that met the ground early [m],
                0 for the others.
            swinging: (6,) legs planned in the air.
            loaded: (6,) legs planned to carry their whole share.
            searching: (6,) feet that the gait clock waits for.
            open_loop: (6,) feet whose sensors have just been doubted.
        """
        self.late = np.where(loaded & ~contact & ~open_loop, self.late + self.period, 0.0)
        self.waited = np.where(searching, self.waited + self.period, 0.0)
        moved = self._moved(contact, falling, swinging, searching)
        self.offset = np.where(open_loop, self._faded(), moved)


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
        airborne: the foot has left the ground since its last landing.
    """

    STATE = ("met", "before", "airborne")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Removes all recorded landings."""
        self.met, self.before = np.full(LEGS, math.inf), np.zeros(LEGS)
        self.airborne: Mask = np.zeros(LEGS, dtype=np.bool_)

    def update(self, contact: Mask, height: Array, swinging: Mask) -> None:
        """Records the landings of this period.

        Args:
            contact: (6,) feet that report a force.
            height: (6,) of the paths over their ends [m].
            swinging: (6,) legs planned in the air.
        """
        landed = contact & self.airborne
        if some(landed):
            self.before = np.where(landed & np.isfinite(self.met), self.met, self.before)
            now = np.where(swinging, np.maximum(height, 0.0), 0.0)
            self.met = np.where(landed, now, self.met)
        self.airborne = (self.airborne | swinging) & ~contact

    def expected(self, contact: Mask, height: Array, swinging: Mask) -> Array:
        """Returns the heights (6,) at which the feet are expected to meet the ground [m] (C35).

        They are 0 before the first landing. Arguments are those of update().
        """
        known = np.where(swinging & ~contact, np.maximum(height, 0.0), self.met)
        return np.maximum(_least_of_others(known), self.before)

    def early(self, expected: Array, height: Array) -> Mask:
        """Returns the feet (6,) that met the ground early (C36).

        Their paths are still above the heights of earlier landings.

        expected: (6,) from expected() [m]; height: (6,) of the paths over their ends [m].
        """
        settled = np.maximum(_least_of_others(self.met), self.before)
        return (self.met > expected + EARLY) & (height > settled + EARLY)
