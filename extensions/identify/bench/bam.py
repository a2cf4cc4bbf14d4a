"""Reads logs of BAM (github.com/Rhoban/bam): an XL330, which reports its duty as load.

Within a row the goal reaches the servo 3.0 ms before the row's time; the angle is read 1.4 ms, the
(late) speed 0.7 ms before it, the voltage 0.7 ms after it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.extensions.identify.bench.log import SPEED_DELAY, BenchLog, column, figure

FULL_DUTY = {"xl330": 885.0}  # of the load, by motor
GAIN = 4096.0 / (2.0 * math.pi) / 256.0  # load for each radian of error and unit of the register
SIGNED = 32767.0  # of a 16-bit number
ANGLE, SPEED, VOLTAGE = (
    -0.0014,
    -0.0007 - SPEED_DELAY,
    0.0007,
)  # s  from a row's time to its readings


def read(path: Path, table: Mapping[str, Any]) -> BenchLog:
    """Returns the log of a file's table. Raises KeyError and others for a file of another kind."""
    entries = table["entries"]
    time, load = column(entries, "timestamp"), column(entries, "load")
    speed, voltage = column(entries, "speed"), column(entries, "input_volts")
    full_duty = figure(FULL_DUTY, table["motor"], "motor", str(path))
    return BenchLog(
        where=str(path),
        motor=table["motor"],
        gain=GAIN / full_duty * table["kp"],
        register=table["kp"],
        mass=float(table["mass"]),
        rod=table.get("arm_mass", 0.0),
        length=float(table["length"]),
        trajectory=table["trajectory"],
        time=time + ANGLE,
        goal=column(entries, "goal_position"),
        angle=column(entries, "position"),
        speed=np.interp(time + ANGLE, time + SPEED, speed),
        duty=np.where(load > SIGNED, load - 2.0 * (SIGNED + 1.0), load) / full_duty,
        voltage=np.interp(time + ANGLE, time + VOLTAGE, voltage),
        on=column(entries, "torque_enable"),
    )
