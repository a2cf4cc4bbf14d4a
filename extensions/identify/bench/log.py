"""Logs of a servo on a pendulum bench.

A horizontal axis turns a rod with a point mass at its end. Angle 0 hangs down. Rows need not be
equally far apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.extensions.identify.log import LEAST_ROWS, LogError
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


def figure(figures: Mapping[Any, float], given: Any, name: str, where: str) -> float:
    """Returns the figure of a log's motor or length. Raises LogError for one without."""
    if given in figures:
        return figures[given]
    known = ", ".join(map(str, figures))
    fix = f"leave the log out, or add the figures of this {name} to the reader"
    raise LogError(f"an unknown {name}", got=given, expected=known, fix=fix, where=where)


def check_log(log: BenchLog) -> None:
    """Raises LogError for numbers and rows that cannot be simulated."""
    for key, name in (("mass", "mass"), ("length", "length"), ("register", "kp")):
        if not 0.0 < getattr(log, key) < np.inf:
            raise _unusable(log, name, getattr(log, key), "a number > 0")
    rows = len(log.time)
    if rows < LEAST_ROWS:
        raise _unusable(log, "entries", rows, f"at least {LEAST_ROWS}")
    for name in ("time", "goal", "angle", "speed", "duty", "voltage", "on"):
        values = getattr(log, name)
        wrong = ~np.isfinite(values)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise _unusable(log, name, f"{values[row]} in row {row + 1}", "finite numbers")
    still = np.diff(log.time) <= 0.0
    if still.any():
        row = int(np.argmax(still))
        got = f"{log.time[row]:g}, {log.time[row + 1]:g} in rows {row + 1}, {row + 2}"
        raise _unusable(log, "time", got, "times that rise")


def _unusable(log: BenchLog, name: str, got: Any, expected: str) -> LogError:
    what, fix = f"a bench log with unusable {name}", "record it again, or leave it out"
    return LogError(what, got=got, expected=expected, fix=fix, where=log.where)
