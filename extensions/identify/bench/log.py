"""Logs of a servo on a pendulum bench.

A horizontal axis turns a rod with a point mass at its end. Angle 0 hangs down. Rows need not be
equally far apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array

# s  by which servos report their speed late, a mean over 40 ms: the angles of the same logs of an
# XL330, a STS3215 and a STS3250 change by it at this delay
SPEED_DELAY = 0.020


@dataclass(frozen=True, kw_only=True)
class BenchLog:
    """One log; all arrays are (rows,)."""

    where: str
    motor: str  # the servo's name in the log
    gain: float  # 1/rad  duty for each radian of position error
    register: float  # the firmware's position gain
    mass: float  # kg  at the end of the rod
    rod: float  # kg  of the rod
    length: float  # m
    trajectory: str
    time: Array  # s
    goal: Array  # rad
    angle: Array  # rad  the encoder's
    speed: Array  # rad/s
    duty: Array  # 1
    voltage: Array  # V
    on: Array  # 1; 0 where the torque is off


# by what logs are held out together
GROUPINGS: dict[str, Callable[[BenchLog], float | str]] = {
    "gain": lambda log: log.register,
    "mass": lambda log: log.mass,
    "length": lambda log: log.length,
    "trajectory": lambda log: log.trajectory,
}
Entries = Sequence[Mapping[str, Any]]


def column(entries: Entries, name: str) -> Array:
    """Returns a column of a log's entries."""
    return np.array([float(entry[name]) for entry in entries])
