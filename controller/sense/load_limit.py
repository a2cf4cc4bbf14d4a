"""Limits the support to the weight that the servos can carry. C: load_limit.h.

Legs that squeeze each other support the torso like an arch: kinematic control needs only 0.6 of the
torque of the planned shares, which contain no squeeze. If a robot is too heavy for its servos
without the arch, the arch must remain. All legs get the same part of their planned loads (C31), so
that no leg yields before the others; below FULL_SUPPORT this part is smaller than the servos allow,
because the torques of the arch are added. A robot that is far too heavy walks under kinematic
control (C33).
"""

from __future__ import annotations

import math

from hexapod_cosim.controller.memory import Stateful

QUICK = 0.2  # 1    of the support's time constant, for the measured weight
NO_SUPPORT, FULL_SUPPORT = 0.54, 0.84  # 1    part of the torque needed that the servos may give
SUPPORT_HELPS, SUPPORT_FAILS = 1.35, 1.5  # 1    torque needed over torque allowed
LIGHTEST, HEAVIEST = 0.5, 4.0  # 1    limits of measured over modelled weight


class LoadLimit(Stateful):
    """Ratio of the robot's weight to the capacity of its servos.

    Attributes:
        weight_ratio: measured over modelled weight, smoothed [1].
        peak: recent peak of the torque that a joint needs for the modelled weight [N m].
        strength: factor on the planned support [1].
        overloaded: the robot is far too heavy for its servos.
    """

    STATE = ("weight_ratio", "peak", "strength", "overloaded")

    def __init__(self, *, most: float, cycle: float, period: float, weight_time: float) -> None:
        """Computes the filter coefficients and resets the state.

        most: largest allowed servo torque [N m]; cycle: of the gait [s]; weight_time: time constant
        with which the support follows the weight [s].
        """
        self.most, self.fade = most, math.exp(-period / cycle)
        self.follow = 1.0 - math.exp(-period / (QUICK * weight_time))
        self.reset()

    def reset(self) -> None:
        """Sets the weight to the modelled one, with full support."""
        self.weight_ratio, self.peak, self.strength = 1.0, 0.0, 1.0
        self.overloaded = False

    def weigh(self, ratio: float) -> None:
        """Filters the ratio of measured to modelled weight of this period (C32)."""
        self.weight_ratio += self.follow * (min(max(ratio, LIGHTEST), HEAVIEST) - self.weight_ratio)

    def step(self, needed: float, scale: float) -> None:
        """Advances the strength by one period (C31, C32).

        needed: largest torque that the plan needs for the modelled weight [N m]; scale: measured
        over modelled weight, by which the support is scaled [1].
        """
        self.peak = max(needed, self.fade * self.peak)
        limit = SUPPORT_HELPS if self.overloaded else SUPPORT_FAILS
        self.overloaded = self.weight_ratio * self.peak > self.most * limit
        allowed = self.most / max(scale * self.peak, self.most)
        part = FULL_SUPPORT * (allowed - NO_SUPPORT) / (FULL_SUPPORT - NO_SUPPORT)
        self.strength = min(allowed, max(part, 0.0))
