"""Reads logs of BAM (github.com/Rhoban/bam): a Dynamixel servo that reports its duty as load.

Within a row the goal reaches the servo 3.0 ms before the row's time; the angle is read 1.4 ms, the
(late) speed 0.7 ms before it, the voltage 0.7 ms after it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.extensions.identify.bench.log import SPEED_DELAY, BenchLog, column

FULL_DUTY = 885.0  # of the load
GAIN = 4096.0 / (2.0 * math.pi) / (256.0 * FULL_DUTY)  # 1/rad for each unit of the register
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
    return BenchLog(
        where=str(path),
        motor=table["motor"],
        gain=GAIN * table["kp"],
        register=table["kp"],
        mass=float(table["mass"]),
        rod=table.get("arm_mass", 0.0),
        length=float(table["length"]),
        trajectory=table["trajectory"],
        time=time + ANGLE,
        goal=column(entries, "goal_position"),
        angle=column(entries, "position"),
        speed=np.interp(time + ANGLE, time + SPEED, speed),
        duty=np.where(load > SIGNED, load - 2.0 * (SIGNED + 1.0), load) / FULL_DUTY,
        voltage=np.interp(time + ANGLE, time + VOLTAGE, voltage),
        on=column(entries, "torque_enable"),
    )
