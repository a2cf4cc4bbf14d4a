"""Reads logs of K-Scale (github.com/kscalelabs/sysid): Feetech servos; `torque` is their load."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.bench.log import SPEED_DELAY, BenchLog, column, figure
from hexapod_cosim.models.arrays import Array

# duty for each radian of position error and unit of the gain register, as K-Scale measured it
GAINS = {"sts3215": 0.164890901, "sts3250": 0.16382926}
RODS = {0.1: 0.036, 0.15: 0.050}  # kg by length [m], from K-Scale's configurations
NEGATIVE = 1024.0  # the load's sign bit
UNITS = 1000.0  # of the load at full duty
LEAST = -3.139  # rad  below it the encoder's register is 0 or 1: the reading failed, as 0 of others


def read(path: Path, table: Mapping[str, Any]) -> BenchLog:
    """Returns the log of a file's table. Raises KeyError and others for a file of another kind."""
    entries, load = table["entries"], np.round(100.0 * column(table["entries"], "torque"))
    time, on = column(entries, "timestamp"), column(entries, "torque_enable")
    angle, voltage = column(entries, "position"), column(entries, "input_volts")
    gain = figure(GAINS, table["motor"], "motor", str(path))
    rod = table.get("arm_mass")
    if rod is None:
        rod = figure(RODS, table["length"], "length", str(path))
    duty = np.where(load >= NEGATIVE, load - NEGATIVE, -load) / UNITS
    return BenchLog(
        where=str(path),
        motor=table["motor"],
        gain=gain * table["kp"],
        register=table["kp"],
        mass=float(table["mass"]),
        rod=rod,
        length=float(table["length"]),
        trajectory=table["trajectory"],
        time=time,
        goal=column(entries, "goal_position"),
        angle=_without(angle, angle < LEAST),
        speed=np.interp(time + SPEED_DELAY, time, column(entries, "speed")),
        duty=_without(duty, (load == 0.0) & (on > 0.0)),
        voltage=_without(voltage, voltage <= 0.0),
        on=on,
    )


def _without(values: Array, failed: NDArray[np.bool_]) -> Array:
    """Returns readings (rows,) with those that failed, unless all did, between their neighbours."""
    rows, good = np.arange(len(values)), ~failed
    return np.interp(rows, rows[good], values[good]) if good.any() else values
