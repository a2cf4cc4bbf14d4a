"""Chooses squeeze and width of the stance by the load of the servos. C: load_adaptation.h.

The squeeze takes load from the femurs. On ground on which feet creep its price is slip, so it has
its set weight there. It has its largest weight (C45) where the ground holds the planned squeeze
(C52), where a servo works above its continuous torque, and where the measured weight needs all the
torque that is allowed. The work of a servo is the square of its torque, smoothed over a gait cycle;
its heat is the same, smoothed with the time in which a small servo warms up.

A robot that is heavier than its model has hotter servos, and the squeeze that relieves them costs
slip. Feet nearer to the hips relieve them as well, because the femurs' levers are shorter, and cost
no slip. So a measured weight above the modelled one narrows the stance, and lowers the set weight
of the squeeze (C53). Without a payload the wider stance is better, because it tips less easily.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array

HEAT_TIME = 60.0  # s    in which a small servo warms up
COOL, HOT = 0.8, 1.0  # 1    mean square torque over that of the rating
EASY, HARD = 0.8, 1.0  # 1    torque needed for the measured weight over torque allowed
OVER, FAR_OVER = 1.0, 1.2  # 1    mean square torque of a gait cycle over that of the rating
CREEPS, HOLDS = 0.75, 0.82  # 1    share of the planned squeeze that is held
MOST_SQUEEZE = 0.95  # 1    weight of the torques when it costs nothing or servos need it
MODELLED, HEAVY = 1.1, 1.2  # 1    measured over modelled weight
SPARED = 0.75  # 1    of the set weight of the squeeze, in the narrow stance


class LoadAdaptation(Stateful):
    """Smoothed squares of the servos' torques, and the weight of the squeeze.

    Attributes:
        work: (6, 3) squares of the feed-forward torques, smoothed over a gait cycle [N2 m2].
        heat: (6, 3) the same, smoothed over a minute [N2 m2].
        weight_ratio: measured over modelled weight, smoothed over a gait cycle [1].
        narrowing: part of the way to the narrow stance [1].
        squeeze: weight of the torques in the planned squeeze [1].
    """

    STATE = ("work", "heat", "weight_ratio", "narrowing", "squeeze")

    def __init__(
        self, *, rating: float, squeeze: float, narrows: bool, cycle: float, period: float
    ) -> None:
        """Resets the state.

        rating: continuous torque of a servo [N m]; squeeze: weight on ground on which feet creep,
        while all servos are cool, 0 for no squeeze at all [1]; narrows: the gait has a narrow
        stance; cycle: of the gait [s]; period [s].
        """
        self.rating, self.cool_squeeze = rating * rating, squeeze  # N2 m2, 1
        self.narrows = narrows
        self.follow_work = 1.0 - math.exp(-period / cycle)
        self.follow = 1.0 - math.exp(-period / HEAT_TIME)
        self.reset()

    def reset(self) -> None:
        """Sets work and heat of all servos to zero, and the squeeze to that of cool servos."""
        self.work, self.heat = np.zeros((2, LEGS, 3))
        self.weight_ratio, self.narrowing = 1.0, 0.0
        self.squeeze = self.cool_squeeze

    def weigh(self, ratio: float) -> None:
        """Advances weight and narrowing by one period (C53).

        ratio: measured over modelled weight [1].
        """
        self.weight_ratio += self.follow_work * (ratio - self.weight_ratio)
        if self.narrows:
            self.narrowing = min(max((self.weight_ratio - MODELLED) / (HEAVY - MODELLED), 0.0), 1.0)

    def planned_weight_ratio(self) -> float:
        """Returns measured over modelled weight, 1 in the wide stance [1] (C53)."""
        return 1.0 + self.narrowing * (self.weight_ratio - 1.0)

    def step(self, torque: Array, needed: float, squeeze_share: float) -> None:
        """Advances by one period, after weigh() (C45).

        torque: (6, 3) feed-forward torques [N m]; needed: largest torque that the measured weight
        needs, over the largest that is allowed [1]; squeeze_share: of the planned squeeze, that the
        ground holds [1].
        """
        square = torque * torque
        self.work = self.work + self.follow_work * (square - self.work)
        self.heat = self.heat + self.follow * (square - self.heat)
        part = max(
            (float(self.heat.max()) / self.rating - COOL) / (HOT - COOL),
            (float(self.work.max()) / self.rating - OVER) / (FAR_OVER - OVER),
            (needed - EASY) / (HARD - EASY),
            (squeeze_share - CREEPS) / (HOLDS - CREEPS) * (1.0 - self.narrowing),
        )
        least = self.cool_squeeze * (1.0 - SPARED * self.narrowing)
        more = max(MOST_SQUEEZE - least, 0.0) if least > 0.0 else 0.0
        self.squeeze = least + more * min(max(part, 0.0), 1.0)
