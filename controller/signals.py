"""Defines the measurements and commands of the controller, and what recorders see of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane
from hexapod_cosim.models.arrays import array_of

DEFAULT_PERIOD = 0.005  # s    between two steps of the controller, and of a co-simulation


def _zeros() -> Array:
    return np.zeros((LEGS, 3))


def _flags() -> Mask:
    return np.zeros(LEGS, dtype=np.bool_)


def _upright() -> Array:
    return np.array([1.0, 0.0, 0.0, 0.0])


@dataclass
class Measurement:
    """Sensor values of the robot. The arrays belong to the caller, who updates them in place."""

    angle: Array = field(default_factory=_zeros)  # rad    (6, 3)
    speed: Array = field(default_factory=_zeros)  # rad/s    (6, 3)
    foot_force: Array = field(default_factory=_zeros)  # N    (6, 3) ground on foot, world axes
    contact: Mask = field(default_factory=_flags)  # (6,)
    quaternion: Array = field(default_factory=_upright)  # 1    (4,) torso to world, w x y z
    # rad/s    (3,) torso, world axes
    angular_velocity: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Raises HexapodError for an array of another shape."""
        shapes = {"contact": (LEGS,), "quaternion": (4,), "angular_velocity": (3,)}
        for name, value in vars(self).items():
            array_of(value, shapes.get(name, (LEGS, 3)), where=name)


@dataclass
class JointCommand:
    """Commands to the servos. The arrays belong to the controller, which rewrites them."""

    angle_ref: Array = field(default_factory=_zeros)  # rad    (6, 3)
    speed_ref: Array = field(default_factory=_zeros)  # rad/s    (6, 3)
    torque_ref: Array = field(default_factory=_zeros)  # N m    (6, 3)
    # rad/s2    (6, 3) planned, for kinematic drives
    acceleration_ref: Array = field(default_factory=_zeros)


@dataclass(frozen=True)
class Diagnostics:
    """Internal quantities for recorders and tests: arrays of six legs that change at every step."""

    swinging: Mask = field(default_factory=_flags)  # planned to be in the air
    # m    (6, 3) centres of the feet as commanded, torso frame, uncorrected
    planned: Array = field(default_factory=_zeros)
    # m    horizontal correction of the feet, x + i y, walking frame
    shift: Plane = field(default_factory=lambda: np.zeros(LEGS, dtype=np.complex128))
    lift: Array = field(default_factory=lambda: np.zeros(LEGS))  # m    vertical correction
    unreachable: Mask = field(default_factory=_flags)  # the joints could not follow
    fallback: Mask = field(default_factory=_flags)  # under kinematic control
    absent: Mask = field(default_factory=_flags)  # out of service: the others walk without it
    outrun: Mask = field(default_factory=_flags)  # too slow for the command: the body walks slower
    doubted: Mask = field(default_factory=_flags)  # force sensors that are replaced by estimates
    # (3, 6) joints and legs: servos that do not follow their commands
    faulty: Mask = field(default_factory=lambda: np.zeros((3, LEGS), dtype=np.bool_))
