"""Decides whether the planned load and the force sensors can be trusted (C33, C34). C: trust.h.

The planned load does not apply to a robot that slides or is far too heavy. Then the trust, a factor
on all torques, goes to 0 and the robot walks under kinematic control.

A sensor is doubted when it contradicts the plan for too long: it reports a force on a foot in the
middle of its swing, or none on a foot that should carry its load while all feet together lack
weight. It is trusted again after one and a half gait cycles without a contradiction. Until then the
load of its foot is what the other feet leave of the weight.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, some

SLIDING_DRAG = 0.55  # 1    common tangential over normal force beyond the plan: only a robot that
# slides exceeds it, or one on a slope of 29 degrees
CALM_CYCLES = 0.5  # 1    gait cycles without sliding until the feet are trusted again
SLIDING_TIME = 0.04  # s    longer than a foot skids when it touches down
TRUSTED = 0.99  # 1    so near to its goal the trust is at it
CONTRADICTION_TIME = 0.10  # s    longest plausible one; it exceeds the lag of the sensors
MISSING_SHARE = 0.92  # 1    of the weight: with less, the force of some foot is not reported
# 1    of the weight: as CONTACT_SHARE, LIFT_SHARE, for a doubted foot; more, because torso and feet
# accelerate
FOUND_PART, GONE_PART = 0.10, 0.03
LEAST_SHARE = 1e-6  # N    of a doubted foot, so that the shares of feet in the air are not 0 / 0
MEMORY_CYCLES = 1.5  # 1    gait cycles without contradiction until a sensor is trusted again


class Trust(Stateful):
    """Trust in the planned load.

    Attributes:
        level: factor on all torques [1].
        slide_periods: periods for which the robot has been sliding.
        recovery_periods: periods that remain until feedback resumes after sliding.
    """

    STATE = ("level", "slide_periods", "recovery_periods")

    def __init__(self, *, cycle: float, period: float, load_time: float) -> None:
        """Trusts the plan. cycle: of the gait [s]; load_time: smoothing of the trust [s]."""
        self.period = period
        self.follow_load = 1.0 - math.exp(-period / load_time)
        self.calm = round(CALM_CYCLES * cycle / period)  # periods
        self.reset()

    def reset(self) -> None:
        """Trusts the plan wholly."""
        self.level = 1.0
        self.slide_periods, self.recovery_periods = 0, 0

    def step(self, drag: float, *, overloaded: bool) -> float:
        """Advances the trust by one period (C33) and returns the level that it goes to, 0 or 1.

        drag: common tangential force of the feet above the plan, over the normal force [1];
        overloaded: the robot is far too heavy for its servos.
        """
        self.slide_periods = self.slide_periods + 1 if drag > SLIDING_DRAG else 0
        if self.slide_periods * self.period > SLIDING_TIME:
            self.recovery_periods = self.calm
        elif self.recovery_periods:
            self.recovery_periods -= 1
        goal = 0.0 if self.recovery_periods or overloaded else 1.0
        if self.level != goal:
            self.level += self.follow_load * (goal - self.level)
            if abs(goal - self.level) < 1.0 - TRUSTED:
                self.level = goal
        return goal


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
        self.period, self.weight, self.missing = period, weight, MISSING_SHARE * weight
        self.memory = MEMORY_CYCLES * cycle
        self.reset()

    def reset(self) -> None:
        """Trusts all force sensors again and forgets their contradictions."""
        self.contradicted, self.left = np.zeros((2, LEGS))

    def busy(self) -> bool:
        """Returns whether some sensor contradicts the plan or is doubted."""
        return some(self.contradicted) or some(self.left)

    def update(self, contact: Mask, total: Array | float, standing: Mask, high: Mask) -> Mask:
        """Advances the times by one period and returns the sensors (6,) that are not trusted.

        Args:
            contact: (6,) feet that report a force.
            total: (6,) for each foot the sum of all normal forces, without its own if it is high
                [N]; or one for all feet.
            standing: (6,) legs that are planned to carry their whole share.
            high: (6,) feet that are planned well above the ground.
        """
        lacking = total < self.missing
        wrong = np.where(high, contact & ~lacking, standing & ~contact & lacking)
        self.contradicted = np.where(wrong, self.contradicted + self.period, 0.0)
        rest = np.maximum(self.left - self.period, 0.0)
        self.left = np.where(self.contradicted > CONTRADICTION_TIME, self.memory, rest)
        return self.left > 0.0

    def found(self, load: Array, contact: Mask) -> Mask:
        """Returns which feet (6,) have contact if their sensors are doubted (C34).

        load: (6,) that replaces the measured one [N]; contact: (6,) a period ago.
        """
        return np.asarray(load > np.where(contact, GONE_PART, FOUND_PART) * self.weight)


def replaced(force: Array, planned: Array, contact: Mask, doubted: Mask) -> Array:
    """Returns the forces (6, 3) [N], with those of the doubted feet replaced (C34).

    Doubted feet carry what the others leave of the weight, in the shares of the plan.

    Args:
        force: (6, 3) that the sensors report [N].
        planned: (6, 3) for the measured weight [N].
        contact: (6,) feet that report a force.
        doubted: (6,) feet, of which there is one at least.
    """
    left = float(planned[:, 2].sum()) - float(force[contact & ~doubted, 2].sum())
    shares = np.where(doubted, planned[:, 2] + LEAST_SHARE, 0.0)
    load = max(left, 0.0) * shares / shares.sum()
    guess = np.column_stack((planned[:, :2], load))
    return np.where(doubted[:, None], guess, force)
