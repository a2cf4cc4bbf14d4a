"""Detects contacts from foot forces, and faulty force sensors. C: contact_detection.h.

A foot touches down when its force rises above one threshold and lifts off when it falls below a
lower one, so that noise near a threshold does not toggle the contact (C23). A sensor is doubted
when it contradicts the plan for too long: it reports a force on a foot in the middle of its swing,
or none on a foot that should carry its load while all feet together lack weight (C34). It is
trusted again after one and a half gait cycles without a contradiction.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask

TOUCH_SHARE = 0.02  # 1    of the weight: a foot with more has touched down
LIFT_SHARE = 0.005  # 1    of the weight: a foot with less has lifted off
AIRBORNE_TIME = 0.06  # s    longest plausible force on a foot in mid-swing
ABSENT_TIME = 0.10  # s    longest plausible lack of force on a standing foot; both exceed the lag
MISSING_SHARE = 0.92  # 1    of the weight: with less, the force of some foot is not reported
MEMORY_CYCLES = 1.5  # 1    gait cycles without contradiction until a sensor is trusted again


class ContactDetector(Stateful):
    """Detects touch-down and lift-off with hysteresis. `touching`: (6,) feet on the ground."""

    STATE = ("touching",)

    def __init__(self, weight: float) -> None:
        """Starts with all feet in the air. weight: of the robot [N]."""
        self.weight = weight
        self.reset()

    def reset(self) -> None:
        """Sets all feet to be in the air."""
        self.touching: Mask = np.zeros(LEGS, dtype=np.bool_)

    def step(self, normal: Array) -> Mask:
        """Updates and returns `touching` for normal forces (6,) [N] (C23)."""
        limit = np.where(self.touching, LIFT_SHARE * self.weight, TOUCH_SHARE * self.weight)
        self.touching = normal > limit
        return self.touching


class SensorWatch(Stateful):
    """Finds the foot sensors that contradict the plan for too long (C34).

    Attributes, (6,) each:
        contradicted: for how long a sensor has contradicted the plan [s].
        left: time until a sensor is trusted again [s].
    """

    STATE = ("contradicted", "left")

    def __init__(self, weight: float, *, cycle: float, period: float) -> None:
        """Starts with all sensors trusted.

        weight: of the robot without payload [N]; cycle: of the gait [s]; period [s].
        """
        self.period, self.missing = period, MISSING_SHARE * weight
        self.memory = MEMORY_CYCLES * cycle
        self.reset()

    def reset(self) -> None:
        """Trusts all force sensors again and forgets their contradictions."""
        self.contradicted, self.left = np.zeros((2, LEGS))

    def busy(self) -> bool:
        """Returns whether some sensor contradicts the plan or is doubted."""
        return bool(self.contradicted.any() or self.left.any())

    @property
    def doubted(self) -> Mask:
        """Returns the sensors (6,) that are not trusted."""
        return self.left > 0.0

    def look(self, touching: Mask, total: float, standing: Mask, high: Mask) -> Mask:
        """Advances the times by one period and returns `doubted`.

        Args:
            touching: (6,) feet that report a force.
            total: the sum of all normal forces [N].
            standing: (6,) legs that are planned to carry their whole share.
            high: (6,) feet that are planned well above the ground.
        """
        absent = (total < self.missing) & standing & ~touching
        wrong = (touching & high) | absent
        self.contradicted = np.where(wrong, self.contradicted + self.period, 0.0)
        too_long = self.contradicted > np.where(high, AIRBORNE_TIME, ABSENT_TIME)
        rest = np.maximum(self.left - self.period, 0.0)
        self.left = np.where(too_long, self.memory, rest)
        return self.doubted
