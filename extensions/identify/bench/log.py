"""Logs of a servo on a pendulum bench.

A horizontal axis turns a rod with a point mass at its end. Angle 0 hangs down. Rows need not be
equally far apart.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.log import LogError

Array = NDArray[np.float64]


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


def is_bench_log(path: Path) -> bool:
    """Returns whether a file may be the log of a servo bench."""
    return path.suffix.lower() == ".json"


def read_bench_log(path: Path) -> BenchLog:
    """Reads a log of BAM or K-Scale. Raises LogError for another file."""
    # they import this module
    from hexapod_cosim.extensions.identify.bench import bam, kscale  # noqa: PLC0415

    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        readers: dict[bool, Callable[[Path, Any], BenchLog]] = {True: kscale.read, False: bam.read}
        return readers["actuator_id" in table](path, table)
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise LogError(
            "no log of a servo bench",
            got=f"{type(error).__name__}: {error}",
            expected="a JSON file of BAM or K-Scale with mass, length, kp and entries",
            fix="name the raw logs, as they were recorded",
            where=str(path),
        ) from error
