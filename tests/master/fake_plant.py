"""A plant without physics for tests of the master: joints follow their commands at once, and the
torso moves along x.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.interface.plant import load_interface
from hexapod_cosim.cosim.master.fmu_block import StepError
from hexapod_cosim.models import load_robot

SPEED = 0.08  # m/s of the torso


class FakeBlock:
    """Variables of the plant, read and written as a block."""

    def __init__(self, plant: FakePlant, names: Sequence[str], buffer: NDArray[Any]) -> None:
        self._plant = plant
        self.names, self.values = tuple(names), buffer

    def get(self) -> None:
        self._plant.log.append("get")
        self.values[:] = [self._plant.values[name] for name in self.names]

    def set(self) -> None:
        self._plant.log.append("set")
        self._plant.values.update(zip(self.names, self.values.tolist(), strict=True))


UNTYPED: Any = object  # so that the fake stands for an Fmu


class FakePlant(UNTYPED):  # type: ignore[misc]
    """A plant with all variables of the default robot's FMU.

    It refuses the step that begins at `refuse_at`, or raises KeyboardInterrupt there if
    `interrupt`.
    """

    def __init__(
        self, *, refuse_at: float = math.inf, interrupt: bool = False, missing: Sequence[str] = ()
    ) -> None:
        self.variables = {
            entry.name: entry
            for entry in load_interface(load_robot("athena")).variables
            if entry.name not in missing
        }
        self.values = {name: float(entry.start or 0.0) for name, entry in self.variables.items()}
        self.values["torso.quaternion[1]"] = 1.0
        self.log: list[str] = []
        self.steps: list[tuple[float, float]] = []
        self._refuse_at, self._interrupt = refuse_at, interrupt

    def names(self, causality: str, kind: str = "Real") -> list[str]:
        return [
            name
            for name, entry in self.variables.items()
            if entry.causality == causality and entry.type == kind
        ]

    def block(self, names: Sequence[str], buffer: NDArray[Any] | None = None) -> FakeBlock:
        boolean = bool(names) and self.variables[names[0]].type == "Boolean"
        return FakeBlock(
            self,
            names,
            np.zeros(len(names), np.int32 if boolean else np.float64) if buffer is None else buffer,
        )

    def parameters(self) -> dict[str, float]:
        return {
            name: value
            for name, value in self.values.items()
            if self.variables[name].causality == "parameter"
        }

    def set_parameters(self, values: Mapping[str, Any]) -> None:
        self.values.update(values)

    def initialise(self, start: float, stop: float) -> None:
        self.log.append("initialise")

    def step(self, t: float, h: float) -> None:
        self.log.append("step")
        if t >= self._refuse_at:
            if self._interrupt:
                raise KeyboardInterrupt
            raise StepError(
                f"the FMU discards the step from {t:g} s",
                reached=t,
                got="the motion has left the numbers",
            )
        self.steps.append((t, h))
        for name, value in list(self.values.items()):
            if name.endswith(".angle_ref"):
                self.values[name.removesuffix("_ref")] = value
        self.values["torso.position[1]"] += SPEED * h


class FakeController:
    """A controller that commands what it has measured, so that the recording shows it."""

    def __init__(self, log: list[str] | None = None) -> None:
        self.log = [] if log is None else log
        self.times: list[float] = []
        self.commands: list[BodyCommand] = []
        self.forces: list[NDArray[np.float64]] = []

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        self.log.append("controller")
        self.times.append(t)
        self.commands.append(command)
        self.forces.append(measurement.foot_force.copy())
        return JointCommand(
            angle_ref=measurement.angle + 0.001,
            speed_ref=measurement.speed,
            torque_ref=np.full((6, 3), t),
        )
