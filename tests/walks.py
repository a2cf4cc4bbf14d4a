"""Synthetic recordings of a walk."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface import load_interface
from hexapod_cosim.cosim.metrics import View, compute_metrics, robot_weight
from hexapod_cosim.cosim.recorder import COMMAND_COLUMNS, Recording
from hexapod_cosim.models import load_robot

Numbers = NDArray[np.floating[Any]] | NDArray[np.bool_]

H, PERIOD, CYCLES = 0.005, 1.0, 10
SPEED = 0.08  # m/s
ROBOT = load_robot("athena")
PARAMETERS = {entry.name: float(entry.start or 0.0) for entry in load_interface(ROBOT).variables if entry.causality == "parameter"}
WEIGHT = robot_weight(PARAMETERS)
DISTANCE = SPEED * PERIOD * (CYCLES - 2)  # m    in the judged cycles


class Walk:
    """A synthetic recording: everything zero until a test says otherwise; the torso moves along x at the commanded speed."""

    def __init__(self, *, cycles: int = CYCLES, speed: float = SPEED) -> None:
        outputs = [entry.name for entry in load_interface(ROBOT).variables if entry.causality == "output"]
        self.names = ("time", *outputs, *COMMAND_COLUMNS)
        self.time = H * np.arange(round(cycles * PERIOD / H) + 1)
        self.data = np.zeros((len(self.time), len(self.names)))
        self.set("time", self.time)
        self.set("torso.quaternion[1]", 1.0)
        self.set("torso.position[1]", speed * self.time)
        self.set("command.vx", SPEED)

    def set(self, name: str, values: Numbers | float) -> None:
        self.data[:, self.names.index(name)] = values

    @property
    def recording(self) -> Recording:
        return Recording(self.names, self.data)

    def metrics(self, **changes: float) -> dict[str, float]:
        parameters = PARAMETERS | {name.replace("__", "."): value for name, value in changes.items()}
        return compute_metrics(View(self.recording, parameters, PERIOD), realtime_factor=42.0)
