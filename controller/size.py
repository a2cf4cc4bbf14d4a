"""Scales the requirements of the design with the size of the robot.

Robots of one shape and density whose lengths are l times as large walk alike, with times that are
sqrt(l) times as long (Froude's number, v^2/(g l)). The default requirements suit legs of SHORTEST
to LONGEST, which include both robots of the package. For other legs, lengths, times, speeds and
rates are scaled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.controller.gains import TRIPOD_LEGS, Requirements
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot

SHORTEST, LONGEST = 0.22, 0.44  # m    coxa, femur and tibia of legs that the figures suit
YIELD = 1.5  # 1    deflection of the suspension over the sag of its leg's servos, at most
LENGTHS = ("deflection", "deflection_limit", "height_limit")
TIMES = ("load_time", "handover_time", "weight_time", "ground_time")
RATES = ("frequency", "attitude_rate", "height_rate", "path_rate", "turn_limit")
SPEEDS = ("speed_limit",)


@dataclass(frozen=True)
class Size:
    """Factors on the requirements of robots of the usual size; 1 leaves them unchanged."""

    length: float

    @property
    def time(self) -> float:
        """Returns the factor on times; its inverse is the factor on rates."""
        return math.sqrt(self.length)

    @property
    def speed(self) -> float:
        """Returns the factor on speeds."""
        return self.length / self.time


def size_of(robot: Robot) -> Size:
    """Returns the factors of a robot, from the mean length of its legs."""
    legs = LegSolver(robot)
    length = float((np.abs(legs.coxa_length) + legs.femur + legs.tibia).mean())
    return Size(length / min(max(length, SHORTEST), LONGEST))


def requirements_for(robot: Robot, **given: Any) -> Requirements:
    """Returns the requirements for a robot's size and servos; given values are used unchanged.

    The deflection of the suspension is limited to YIELD times that of the servos: their ratio is
    the gain of the suspension's loop, which would have no margins otherwise.
    """
    size, usual = size_of(robot), Requirements()
    factors = (
        (LENGTHS, size.length),
        (TIMES, size.time),
        (RATES, 1.0 / size.time),
        (SPEEDS, size.speed),
    )
    asked = {name: getattr(usual, name) * factor for names, factor in factors for name in names}
    if robot.servo.kp > 0.0:
        asked["deflection"] = min(asked["deflection"], YIELD * sag(robot))
    return Requirements(**{**asked, **given})


def sag(robot: Robot) -> float:
    """Returns the sag [m] of a leg on its servos in the stance under a third of the weight.

    It is the mean over the legs.
    """
    vertical = LegSolver(robot).jacobian(robot.stance)[:, 2]
    softness = float((vertical**2).sum(axis=1).mean() / robot.servo.kp)
    return softness * robot.weight / TRIPOD_LEGS
