"""Reads logs of K-Scale (github.com/kscalelabs/sysid): Feetech servos; `torque` is their load."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.extensions.identify.bench.log import BenchLog, column

# duty for each radian of position error and unit of the gain register, as K-Scale measured it
GAINS = {"sts3215": 0.164890901, "sts3250": 0.16382926}
RODS = {0.1: 0.036, 0.15: 0.050}  # kg by length [m], from K-Scale's configurations
NEGATIVE = 1024.0  # the load's sign bit
UNITS = 1000.0  # of the load at full duty


def read(path: Path, table: Mapping[str, Any]) -> BenchLog:
    """Returns the log of a file's table. Raises KeyError and others for a file of another kind."""
    entries, load = table["entries"], np.round(100.0 * column(table["entries"], "torque"))
    voltage = column(entries, "input_volts")
    return BenchLog(
        where=str(path),
        motor=table["motor"],
        gain=GAINS[table["motor"]] * table["kp"],
        register=table["kp"],
        mass=table["mass"],
        rod=table.get("arm_mass", RODS[table["length"]]),
        length=table["length"],
        trajectory=table["trajectory"],
        time=column(entries, "timestamp"),
        goal=column(entries, "goal_position"),
        angle=column(entries, "position"),
        speed=column(entries, "speed"),
        duty=np.where(load >= NEGATIVE, load - NEGATIVE, -load) / UNITS,
        voltage=np.where(voltage > 0.0, voltage, np.median(voltage)),  # 0: a failed reading
        on=column(entries, "torque_enable"),
    )
