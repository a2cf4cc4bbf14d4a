"""Decides whether the planned load applies to the robot (C33). C: trust.h.

It does not apply to a robot that slides, whose joints cannot follow, or that is far too heavy.
Then the trust, a factor on all torques, goes to 0 and the robot walks under kinematic control.
"""

from __future__ import annotations

import math

from hexapod_cosim.controller.memory import Stateful

SLIDING_DRAG = 0.55  # 1    common tangential over normal force beyond the plan: only a robot that
# slides exceeds it, or one on a slope of 29 degrees
CALM_CYCLES = 0.5  # 1    gait cycles without sliding until the feet are trusted again
SLIDING_TIME = 0.04  # s    longer than a foot skids when it touches down
JOINTS_FOLLOW, JOINTS_DO_NOT = 0.35, 0.45  # 1    share of the time with too high joint speeds
FEET_LATE = 0.2  # 1    the same, from which feet end their swings late whatever the ground
TRUSTED = 0.99  # 1    so near to its goal the trust is at it


class Trust(Stateful):
    """Trust in the planned load.

    Attributes:
        level: factor on all torques [1].
        lagging: the joints cannot follow the plan.
        overspeed_share: share of the time in which the plan exceeds a speed limit [1].
        slide_periods: periods for which the robot has been sliding.
        recovery_periods: periods that remain until feedback resumes after sliding.
    """

    STATE = ("level", "lagging", "overspeed_share", "slide_periods", "recovery_periods")

    def __init__(self, *, cycle: float, period: float, load_time: float) -> None:
        """Trusts the plan. cycle: of the gait [s]; load_time: smoothing of the trust [s]."""
        self.period = period
        self.follow_load = 1.0 - math.exp(-period / load_time)
        self.follow_cycle = 1.0 - math.exp(-period / cycle)
        self.calm = round(CALM_CYCLES * cycle / period)  # periods
        self.reset()

    def reset(self) -> None:
        """Trusts the plan wholly."""
        self.level, self.lagging, self.overspeed_share = 1.0, False, 0.0
        self.slide_periods, self.recovery_periods = 0, 0

    def feet_late(self) -> bool:
        """Returns whether the joints are so slow that feet end their swings late anywhere."""
        return self.overspeed_share > FEET_LATE

    def step(self, drag: float, *, overspeed: bool, overburdened: bool) -> float:
        """Advances the trust by one period (C33) and returns the level that it goes to, 0 or 1.

        drag: common tangential force of the feet above the plan, over the normal force [1];
        overspeed: the plan exceeds the speed limit of some joint; overburdened: the robot is far
        too heavy for its servos.
        """
        self.overspeed_share += self.follow_cycle * (float(overspeed) - self.overspeed_share)
        self.lagging = self.overspeed_share > (JOINTS_FOLLOW if self.lagging else JOINTS_DO_NOT)
        self.slide_periods = self.slide_periods + 1 if drag > SLIDING_DRAG else 0
        if self.slide_periods * self.period > SLIDING_TIME:
            self.recovery_periods = self.calm
        elif self.recovery_periods:
            self.recovery_periods -= 1
        goal = 0.0 if self.recovery_periods or self.lagging or overburdened else 1.0
        if self.level != goal:
            self.level += self.follow_load * (goal - self.level)
            if abs(goal - self.level) < 1.0 - TRUSTED:
                self.level = goal
        return goal
