"""Drives a controller FMU through the interface of the Python `Controller`."""

from __future__ import annotations

from dataclasses import astuple, fields

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, Diagnostics, JointCommand, Measurement
from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.signals import ACCELERATION, COMMANDED, MEASURED
from hexapod_cosim.models import LEG_NAMES

LEGS = len(LEG_NAMES)
COMMANDS = [f"command.{item.name}" for item in fields(BodyCommand)]
SENSED = ("angle", "foot_force", "quaternion")  # fields of the measurement that the FMU reads
FLAGS = ("swinging", "unreachable", "fallback")


class FmuController:
    """Steps an initialised controller FMU; `period` [s] is the length of its steps."""

    def __init__(self, fmu: Fmu, *, period: float) -> None:
        self._fmu, self._period = fmu, period
        self._inputs = fmu.block([*COMMANDS, *(name for key in SENSED for name in MEASURED[key])])
        shift = [name for leg in LEG_NAMES for name in vector_names(f"{leg}.shift", 2)]
        joints = [name for names in COMMANDED.values() for name in names]
        acceleration_names = ACCELERATION if set(ACCELERATION) <= set(fmu.names("output")) else []
        lifts_and_plan = [f"{leg}.lift" for leg in LEG_NAMES]
        lifts_and_plan += [name for leg in LEG_NAMES for name in vector_names(f"{leg}.planned")]
        self._outputs = fmu.block([*joints, *shift, *lifts_and_plan, *acceleration_names])
        self._flags = fmu.block([f"{leg}.{flag}" for flag in FLAGS for leg in LEG_NAMES])
        ends = LEGS * np.array([3, 6, 9, 11, 12, 15])
        angle, speed, torque, shifts, lifts, feet, acceleration = np.split(
            self._outputs.values, ends
        )
        self._out = JointCommand(*(part.reshape(LEGS, 3) for part in (angle, speed, torque)))
        if acceleration_names:
            self._out.acceleration_ref = acceleration.reshape(LEGS, 3)
        swinging, unreachable, fallback = self._flag_values = np.zeros(
            (len(FLAGS), LEGS), dtype=np.bool_
        )
        self.diagnostics = Diagnostics(
            swinging,
            feet.reshape(LEGS, 3),
            shifts.view(np.complex128),
            lifts,
            unreachable,
            fallback,
        )

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for [t, t + period). Raises FmuError.

        The next step reuses the arrays of the result.
        """
        self._write_inputs(command, measurement)
        self._outputs.get()
        self._flags.get()
        self._flag_values[...] = self._flags.values.reshape(self._flag_values.shape)
        self._fmu.step(t, self._period)
        return self._out

    def _write_inputs(self, command: BodyCommand, measurement: Measurement) -> None:
        parts: list[NDArray[np.float64]] = [getattr(measurement, key).ravel() for key in SENSED]
        np.concatenate([astuple(command), *parts], out=self._inputs.values)
        self._inputs.set()
