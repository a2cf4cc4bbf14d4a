"""Provides synthetic recordings of walks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.master.recorder import COMMAND_COLUMNS, Recording
from hexapod_cosim.cosim.results.metrics import PLANNED, compute_metrics
from hexapod_cosim.cosim.results.window import View, robot_weight, running_integral
from hexapod_cosim.models import LEG_NAMES, load_robot

Numbers = NDArray[np.floating[Any]] | NDArray[np.bool_]

H, PERIOD, CYCLES = 0.005, 1.0, 10
SPEED = 0.08  # m/s
ROBOT = load_robot("athena")
PARAMETERS = {
    entry.name: float(entry.start or 0.0)
    for entry in load_interface(ROBOT).variables
    if entry.causality == "parameter"
}
SERVO = replace(ROBOT.servo, torque_continuous=1.2, motor_constant=0.8)
WEIGHT = robot_weight(PARAMETERS)
JUDGED = PERIOD * (CYCLES - 2)  # s    of the cycles of the metrics
DISTANCE = SPEED * JUDGED  # m    in these


class SyntheticRun:
    """A synthetic recording whose values are zero unless a test sets them; the torso moves along x
    at the commanded speed.

    h: time between rows [s]. planned: whether the controller outputs the planned feet.
    """

    def __init__(
        self, *, cycles: float = CYCLES, speed: float = SPEED, h: float = H, planned: bool = False
    ) -> None:
        outputs = [
            entry.name for entry in load_interface(ROBOT).variables if entry.causality == "output"
        ]
        planned_columns = (
            (*PLANNED, *(f"controller.{leg}.swinging" for leg in LEG_NAMES)) if planned else ()
        )
        self.names = ("time", *outputs, *planned_columns, *COMMAND_COLUMNS)
        self.time: NDArray[np.float64] = h * np.arange(
            round(cycles * PERIOD / h) + 1, dtype=np.float64
        )
        self.data = np.zeros((len(self.time), len(self.names)))
        self.set("time", self.time)
        self.set("torso.quaternion[1]", 1.0)
        self.set("torso.position[1]", speed * self.time)
        self.set("command.vx", SPEED)

    def set(self, name: str, values: Numbers | float) -> None:
        self.data[:, self.names.index(name)] = values

    def grow(self, name: str, rate: Numbers | float) -> None:
        """Sets a cumulative output from its rate at the rows."""
        rates = np.broadcast_to(np.asarray(rate, dtype=float), self.time.shape)
        self.set(name, running_integral(self.time, rates))

    @property
    def recording(self) -> Recording:
        return Recording(self.names, self.data)

    def metrics(self, **changes: float) -> dict[str, float]:
        parameters = PARAMETERS | {
            name.replace("__", "."): value for name, value in changes.items()
        }
        return compute_metrics(
            View(self.recording, parameters, PERIOD), servo=SERVO, realtime_factor=42.0
        )
