"""How much of the robot's weight its servos can carry, and what follows from it. C: burden.c.

Legs that squeeze each other hold the robot up like an arch: kinematic control asks 0.6 of the
torque of them that the planned shares do, which have no squeeze. A robot heavier than its servos
carry without the arch has to keep it. All legs are asked for the same part of their shares (C31),
so that none gives way before the others; below FULL_SUPPORT for less than the servos have, as what
the arch asks of them comes on top. The slip PID takes no squeeze away that carries (C32). A robot
far too heavy walks under kinematic control.
"""

from __future__ import annotations

import math

from hexapod_cosim.controller.memory import Stateful

QUICK = 0.2  # 1    of the time in which the support follows the weight: the arch must not go first
NO_SUPPORT, FULL_SUPPORT = 0.54, 0.84  # 1    part of the torque needed that the servos may give
ARCH_STAYS, ARCH_GOES = 0.8, 0.95  # 1    part of the weight that the servos carry without the arch
SUPPORT_HELPS, SUPPORT_FAILS = 1.35, 1.5  # 1    torque needed over torque allowed
LIGHTEST, HEAVIEST = 0.5, 4.0  # 1    measured over modelled weight: less or more is no weight


class Burden(Stateful):
    """The weight that the servos carry.

    Attributes:
        heft: measured over modelled weight [1].
        peak: the largest torque of late that a joint needs to carry the model's weight [N m].
        strength: part of the planned support that is given [1].
        freedom: part of the squeeze that the slip PID may take away [1].
        overburdened: the robot is far too heavy for its servos.
    """

    STATE = ("heft", "peak", "strength", "freedom", "overburdened")

    def __init__(self, *, most: float, cycle: float, period: float, weight_time: float) -> None:
        """most: torque that a servo may be asked for [N m].

        cycle: of the gait [s]; weight_time: in which the support follows the weight [s].
        """
        self.most, self.fade = most, math.exp(-period / cycle)
        self.follow = 1.0 - math.exp(-period / (QUICK * weight_time))
        self.reset()

    def reset(self) -> None:
        """As heavy as the model."""
        self.heft, self.peak, self.strength, self.freedom = 1.0, 0.0, 1.0, 1.0
        self.overburdened = False

    def weigh(self, ratio: float) -> None:
        """Takes the measured over the modelled weight of this period (C31)."""
        self.heft += self.follow * (min(max(ratio, LIGHTEST), HEAVIEST) - self.heft)

    def step(self, needed: float, scale: float) -> None:
        """One period on (C31, C32).

        needed: largest torque to carry the model's weight [N m]; scale: measured over modelled
        weight, as the support believes it [1].
        """
        self.peak = max(needed, self.fade * self.peak)
        limit = SUPPORT_HELPS if self.overburdened else SUPPORT_FAILS
        self.overburdened = self.heft * self.peak > self.most * limit
        allowed = self.most / max(scale * self.peak, self.most)
        carried = self.most / max(self.heft * self.peak, self.most)
        part = FULL_SUPPORT * (allowed - NO_SUPPORT) / (FULL_SUPPORT - NO_SUPPORT)
        self.strength = min(allowed, max(part, 0.0))
        self.freedom = min(max((carried - ARCH_STAYS) / (ARCH_GOES - ARCH_STAYS), 0.0), 1.0)
