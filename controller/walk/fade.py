"""Lets joint commands go on without a jump when the control changes. C: fade.h.

At the first step under another control, the distance of its commands from those that the control
before would give is computed. It is added to the commands, and goes to 0 by the cubic of the
command ramp (C1): at that step angles and speeds are those of the control before, and after
FADE_TIME those of the present one.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, clamp
from hexapod_cosim.controller.signals import JointCommand
from hexapod_cosim.controller.walk.kinematics import LegSolver

FADE_TIME = 0.4  # s    duration of a transition


class Fade(Stateful):
    """What is added to the joint commands of the present control.

    Attributes:
        left: steps of the transition that are left; 0: none.
        angle, speed, torque: (6, 3) distances at the begin of the transition [rad, rad/s, N m];
            before its first step, the commands that the control before would give at that step.
    """

    STATE = ("left", "angle", "speed", "torque")

    def __init__(self, *, period: float) -> None:
        self.period = period
        self.steps = max(round(FADE_TIME / period), 1)
        self.reset()

    def reset(self) -> None:
        """Ends a transition."""
        self.left = 0
        self.angle, self.speed, self.torque = np.zeros((3, LEGS, 3))

    def begin(self, last: JointCommand) -> None:
        """Begins a transition from the commands of the last step, continued by a period."""
        self.left = self.steps
        self.angle = last.angle_ref + last.speed_ref * self.period
        self.speed, self.torque = last.speed_ref.copy(), last.torque_ref.copy()

    def _compare(self, out: JointCommand) -> None:
        """Computes the distances of the commands of the control before from the present ones."""
        self.angle = self.angle - out.angle_ref
        self.speed = self.speed - out.speed_ref
        self.torque = self.torque - out.torque_ref

    def step(self, legs: LegSolver, out: JointCommand) -> None:
        """Adds to the commands of a step, in place, what is left of their distances."""
        if self.left == 0:
            return
        if self.left == self.steps:
            self._compare(out)
        time, x = self.steps * self.period, (self.steps - self.left) / self.steps
        rest = 1.0 - x
        part, slope = rest * rest * (1.0 + 2.0 * x), x * rest * rest * time
        part_rate, slope_rate = -6.0 * x * rest / time, rest * (1.0 - 3.0 * x)
        part_bend, slope_bend = (12.0 * x - 6.0) / (time * time), (6.0 * x - 4.0) / time
        angle = out.angle_ref + part * self.angle + slope * self.speed
        out.angle_ref[...] = clamp(angle, legs.angle_min, legs.angle_max)
        out.speed_ref += part_rate * self.angle + slope_rate * self.speed
        out.torque_ref += part * self.torque
        out.acceleration_ref += part_bend * self.angle + slope_bend * self.speed
        self.left -= 1
