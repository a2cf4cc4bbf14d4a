"""Provides robots of the same shape and density in other sizes, by Froude's similarity.

Lengths are multiplied by l, masses by l^3, times by sqrt(l).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from hexapod_cosim.models import Robot

Part = TypeVar("Part")
# exponents of l in the numbers of a robot's parts
LINK = {"mass": 3, "com": 1, "inertia": 5, "length": 1, "offset_y": 1, "offset_z": 1}
PARTS: Mapping[str, Mapping[str, float]] = {
    "torso": {"mass": 3, "size": 1, "com": 1, "inertia": 5},
    "foot": {"radius": 1, "youngs_modulus": 1},
    # K in F = K d^1.5 is proportional to sqrt(R) E
    "contact": {"stiffness": 1.5, "damping_factor": -0.5, "impact_speed_floor": 0.5},
    "friction": {"slope": -0.5, "presliding": 1, "bristle_damping": 0.5},
    "servo": {
        "kp": 4,
        "kd": 4.5,
        "torque_max": 4,
        "speed_max": -0.5,
        "rotor_inertia": 5,
        "coulomb_friction": 4,
        "torque_continuous": 4,
    },
    "baumgarte": {"alpha": -0.5, "beta": -0.5},
    "solver": {"step": 0.5, "step_max": 0.5},
    "gait": {"period": 0.5, "stride": 1, "step_height": 1},
}


def scaled_part(part: Part, by: float, exponents: Mapping[str, float]) -> Part:
    """Multiplies fields of a dataclass, numbers or vectors, by powers of a factor."""

    def times(value: float | tuple[float, ...], exponent: float) -> float | tuple[float, ...]:
        factor = by**exponent
        return tuple(factor * x for x in value) if isinstance(value, tuple) else factor * value

    changes = {name: times(getattr(part, name), power) for name, power in exponents.items()}
    return replace(part, **changes)  # type: ignore[type-var]


def scaled_robot(robot: Robot, by: float) -> Robot:
    """Returns a robot whose motion is similar, with times multiplied by sqrt(by).

    Forces are multiplied by by^3, torques by by^4, moduli of elasticity by by.
    """
    legs = []
    for leg in robot.legs:
        coxa, femur, tibia = (scaled_part(link, by, LINK) for link in leg.links)
        moved = scaled_part(leg, by, {"hip_position": 1})
        legs.append(replace(moved, links=(coxa, femur, tibia)))
    parts = {name: scaled_part(getattr(robot, name), by, powers) for name, powers in PARTS.items()}
    return replace(robot, name=f"{robot.name}_times_{by:g}", legs=tuple(legs), **parts)
