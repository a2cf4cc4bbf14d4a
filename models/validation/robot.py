"""Checks a robot as a whole."""

from __future__ import annotations

import math

from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.records import LEG_NAMES, Robot
from hexapod_cosim.models.schema import Vector, check_record
from hexapod_cosim.models.validation.bodies import (
    check_com,
    check_inertia,
    check_leg,
    check_rotors,
    check_stance,
)
from hexapod_cosim.models.validation.laws import check_laws

# matter lies within the box; real torsos stay below half of this limit
GYRATION_PER_DIAGONAL = 1.0
# sections that do not concern the bodies
SETTINGS = ("contact", "friction", "servo", "baumgarte", "solver", "terrain", "soil", "body")


def check_robot(robot: Robot, *, where: str | None = None) -> None:
    """Checks a robot. Raises RobotError for the first violated rule.

    where: name of the robot's file for messages.
    """
    at = f"{where or robot.name}: "
    Vector("m/s2", 3).read(robot.gravity, at + "gravity")
    for name in ("torso", "foot", "gait"):
        check_record(getattr(robot, name), at + name)
    check_settings(robot, where=where)
    check_inertia(
        robot.torso.mass,
        robot.torso.inertia,
        GYRATION_PER_DIAGONAL * math.hypot(*robot.torso.size),
        at + "torso",
    )
    check_com(robot.torso.com, math.hypot(*robot.torso.size), at + "torso")
    if tuple(leg.name for leg in robot.legs) != LEG_NAMES:
        expected = "legs " + " ".join(LEG_NAMES)
        got = [leg.name for leg in robot.legs]
        fix = "give these six in this order"
        raise RobotError("wrong legs", got=got, expected=expected, fix=fix, where=at + "legs")
    for leg in robot.legs:
        check_leg(leg, f"{at}legs.{leg.name}")
    check_rotors(robot, at)
    check_stance(robot, at)


def check_settings(robot: Robot, *, where: str | None = None) -> None:
    """Checks the robot's laws and settings only, for a robot with checked bodies.

    Raises RobotError.
    """
    at = f"{where or robot.name}: "
    for name in SETTINGS:
        check_record(getattr(robot, name), at + name)
    check_laws(robot, at)
