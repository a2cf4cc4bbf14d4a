"""Unknown numbers of a robot file: how each is read, written and limited.

Imports `models` alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from hexapod_cosim.models import Robot
from hexapod_cosim.models.servos.presets import followed

QUANTILE = 1.959963985  # of a normal distribution, for 95 %
ALWAYS: Callable[[Robot], bool] = lambda _robot: True  # noqa: E731


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A number to be found."""

    key: str
    unit: str
    group: str
    prior: float  # standard deviation; of the logarithm where `positive`
    positive: bool = True  # its logarithm is estimated
    low: float = -math.inf
    high: float = math.inf
    # how the robot file's value is read and replaced; a number of sensors begins at a fixed one
    read: Callable[[Robot], float] = lambda _robot: 0.0
    write: Callable[[Robot, float], Robot] = lambda robot, _value: robot
    applies: Callable[[Robot], bool] = ALWAYS
    prior_of: Callable[[Robot], float] | None = None  # where the prior depends on the robot
    limits_of: Callable[[Robot], tuple[float, float]] | None = None  # likewise low and high

    def value(self, z: float, before: float) -> float:
        """Returns the value at a distance z from the value before, in units of the prior."""
        if self.positive:
            return min(before * math.exp(self.prior * z), self.high)
        return min(max(before + self.prior * z, self.low), self.high)

    def distance(self, value: float, before: float) -> float:
        """Returns the z of a value, within the limits of z."""
        own = math.log(value / before) if self.positive else value - before
        low, high = self.bounds(before)
        return min(max(own / self.prior, low), high)

    def interval(self, value: float, deviation: float) -> tuple[float, float]:
        """Returns the interval of 95 % for a standard deviation in units of the prior."""
        half = self.prior * (QUANTILE * deviation)
        if self.positive:
            return value * math.exp(-half), value * math.exp(half)
        return value - half, value + half

    def of_robot(self, robot: Robot) -> Unknown:
        """Returns the row with the prior and the limits of a robot."""
        prior = self.prior_of(robot) if self.prior_of else self.prior
        low, high = self.limits_of(robot) if self.limits_of else (self.low, self.high)
        return replace(self, prior=prior, low=low, high=high)

    def bounds(self, before: float) -> tuple[float, float]:
        """Returns the limits of z."""
        if self.positive:
            return -FURTHEST, min(math.log(self.high / before) / self.prior, FURTHEST)
        low, high = (self.low - before) / self.prior, (self.high - before) / self.prior
        return max(low, -FURTHEST), min(high, FURTHEST)


FURTHEST = 8.0  # priors from the value before


def section(name: str, unit: str, group: str, prior: float, **more: Any) -> Unknown:
    """Returns the row of a number in a section of robot files, named "section.key".

    What follows from constants of a measured servo, as its largest torque, changes with them.
    """
    section, _, key = name.partition(".")

    def read(robot: Robot) -> float:
        return float(getattr(getattr(robot, section), key))

    def write(robot: Robot, value: float) -> Robot:
        changed: Any = replace(getattr(robot, section), **{key: value})
        if section == "servo" and changed.drive == "motor":
            changed = followed(changed)
        sections: dict[str, Any] = {section: changed}
        return replace(robot, **sections)

    return Unknown(key=name, unit=unit, group=group, prior=prior, read=read, write=write, **more)
