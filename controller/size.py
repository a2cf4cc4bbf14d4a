"""Scales the requirements of the design with the size of the robot.

Robots of one shape and density whose lengths are l times as large walk alike, with times that are
sqrt(l) times as long (Froude's number, v^2/(g l)). The default requirements suit legs of SHORTEST
to LONGEST, which include the robots of the package. For other legs, lengths, times, speeds and
rates are scaled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeVar, get_type_hints

import numpy as np

from hexapod_cosim.controller.gains import SECTIONS, LimitGains, PaperGains, Requirements, Row
from hexapod_cosim.controller.plane import LEGS
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot
from hexapod_cosim.models.schema import specs

FIXED = ("filter_time",)  # of the sensors, whatever the size of the robot
SHORTEST, LONGEST = 0.22, 0.44  # m    coxa, femur and tibia of legs that the figures suit
_Section = TypeVar("_Section")


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


def _units() -> dict[str, str]:
    """Returns the units of the requirements that are scaled, by name: those of the gains."""
    own = {"deflection_limit": "m", "landing_speed": "m/s"}
    for kind in SECTIONS.values():
        for name, hint in get_type_hints(kind, include_extras=True).items():
            for fact in getattr(hint, "__metadata__", ()):
                if isinstance(fact, Row):
                    own[name] = fact.unit
    return {name: own[name] for name in specs(Requirements) if name in own and name not in FIXED}


def requirements_for(robot: Robot, **given: Any) -> Requirements:
    """Returns the requirements for a robot's size; given values are used unchanged."""
    size, usual = size_of(robot), Requirements()
    rate = 1.0 / size.time
    factors = {"m": size.length, "s": size.time, "1/s": rate, "rad/s": rate, "m/s": size.speed}
    asked = {
        name: getattr(usual, name) * factors[unit]
        for name, unit in _units().items()
        if unit in factors
    }
    return Requirements(**{**asked, **given})


def taken(kind: type[_Section], needs: Requirements, **given: float) -> _Section:
    """Returns a section of the gains whose values are those of the requirements, or given ones."""
    names = [name for name in specs(kind) if name not in given]
    return kind(**{name: getattr(needs, name) for name in names}, **given)


def paper_gains(robot: Robot, needs: Requirements) -> PaperGains:
    """Returns the gains of the paper's control before the design limits its shares."""
    damping = robot.weight / (LEGS * needs.landing_speed)
    return taken(PaperGains, needs, damping=damping, limit=needs.deflection_limit)


def limit_gains(robot: Robot, needs: Requirements) -> LimitGains:
    """Returns the limit of commanded torques [N m]."""
    return LimitGains(torque=needs.torque_share * robot.servo.torque_max)


def sections_for(robot: Robot, needs: Requirements) -> dict[str, Any]:
    """Returns the sections of the gains before the design limits the paper's shares, by name."""
    asked = specs(Requirements).keys()
    plain = {name: kind for name, kind in SECTIONS.items() if specs(kind).keys() < asked}
    return {
        **{name: taken(kind, needs) for name, kind in plain.items()},
        "limits": limit_gains(robot, needs),
        "paper": paper_gains(robot, needs),
    }
