"""Raises the planned squeeze while servos are warm or near their torque limit. C: warmth.c.

The heat of a servo is the square of its torque, smoothed with a time in which a small servo warms
up (C45). The squeeze takes load from the femurs at the price of slip, so it has its set weight
while the servos are cool and strong enough, and its largest weight once one of them works at its
continuous torque, or the measured weight needs all the torque that is allowed.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array

HEAT_TIME = 60.0  # s    in which a small servo warms up
COOL, HOT = 0.8, 1.0  # 1    mean square torque over that of the rating
EASY, HARD = 0.8, 1.0  # 1    torque needed for the measured weight over torque allowed
MOST_SQUEEZE = 0.95  # 1    weight of the torques when a servo is hot or short of torque


class Warmth(Stateful):
    """Smoothed squares of the servos' torques, and the weight of the squeeze that follows.

    Attributes:
        heat: (6, 3) smoothed squares of the feed-forward torques [N2 m2].
        squeeze: weight of the torques in the planned squeeze [1].
    """

    STATE = ("heat", "squeeze")

    def __init__(self, *, rating: float, squeeze: float, period: float) -> None:
        """Resets the state. rating: continuous torque of a servo [N m]; squeeze: weight while all
        servos are cool, 0 for no squeeze at all [1]; period [s].
        """
        self.rating, self.cool_squeeze = rating * rating, squeeze  # N2 m2, 1
        self.more = max(MOST_SQUEEZE - squeeze, 0.0) if squeeze > 0.0 else 0.0
        self.follow = 1.0 - math.exp(-period / HEAT_TIME)
        self.reset()

    def reset(self) -> None:
        """Sets the heat of all servos to zero, and the squeeze to that of cool servos."""
        self.heat, self.squeeze = np.zeros((LEGS, 3)), self.cool_squeeze

    def step(self, torque: Array, needed: float) -> None:
        """Advances by one period (C45).

        torque: (6, 3) feed-forward torques [N m]; needed: largest torque that the measured weight
        needs, over the largest that is allowed [1].
        """
        self.heat = self.heat + self.follow * (torque * torque - self.heat)
        hot = (float(self.heat.max()) / self.rating - COOL) / (HOT - COOL)
        part = max(hot, (needed - EASY) / (HARD - EASY))
        self.squeeze = self.cool_squeeze + self.more * min(max(part, 0.0), 1.0)
