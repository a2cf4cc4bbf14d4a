"""Calls the C controller from Python.

An instance has the interface of `Controller` and is set up through the C library's table of ranges.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
from mirror import OK, ROOT, Real

from hexapod_cosim.controller import BodyCommand, Gait, Measurement
from hexapod_cosim.cosim.interface.controller import ControllerSetup, load_controller_interface
from hexapod_cosim.cosim.master.loop_library import Header

COMMANDS = ("angle_ref", "speed_ref", "torque_ref", "acceleration_ref")
HEADER = Header(
    *(ROOT / f"plant_fmu/include/hexapod/{name}.h" for name in ("legs", "status")),
    *(
        ROOT / f"controller/fmu/include/hexapod/{name}.h"
        for name in ("generated/controller_settings", "controller")
    ),
)
HxRange: Any = HEADER.types["hxRange"]
HxControllerInput: Any = HEADER.types["hxControllerInput"]
HxControllerOutput: Any = HEADER.types["hxControllerOutput"]
HxControllerDefinition: Any = HEADER.types["hxControllerDefinition"]
HxGait: Any = HEADER.types["hxGait"]


class NativeError(Exception):
    """A call failed: its status and message."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


def bound(core: ct.CDLL) -> ct.CDLL:
    """Declares the types of the library's functions; may be called repeatedly."""
    return HEADER.bind(core)


def ranges_of(core: ct.CDLL, member: str) -> dict[str, Any]:
    """Returns the C library's table for "definition" or "input" by variable names."""
    table = ct.POINTER(HxRange)()
    count = getattr(core, f"hx_controller_{member}_ranges")(ct.byref(table))
    return {table[k].name.decode(): table[k] for k in range(count)}


class Definition:
    """An hxControllerDefinition, `bytes`, set by variable names."""

    def __init__(self, core: ct.CDLL, setup: ControllerSetup) -> None:
        self.ranges = ranges_of(core, "definition")
        self.bytes = HxControllerDefinition()
        core.hx_controller_definition_default(self.bytes)
        for variable in load_controller_interface(setup).of_causality("parameter"):
            self[variable.name] = variable.start

    def __setitem__(self, name: str, value: Any) -> None:
        entry = self.ranges[name]
        kind = ct.c_int if entry.is_int else Real
        kind.from_buffer(self.bytes, entry.offset).value = int(value) if entry.is_int else value


class NativeController:
    """A C controller. `step` is that of `Controller`; `out` holds the last commands."""

    def __init__(self, core: ct.CDLL, setup: ControllerSetup, *, start: float = 0.0) -> None:
        self._core, self.period, self.definition = (
            bound(core),
            setup.period,
            Definition(core, setup),
        )
        self._setup = setup
        self._handle = core.hx_controller_create()
        self.input, self.out = HxControllerInput(), HxControllerOutput()
        self.reset(start)

    def __del__(self) -> None:
        self._core.hx_controller_destroy(self._handle)

    def _checked(self, status: int) -> None:
        if status != OK:
            raise NativeError(status, self._core.hx_controller_message(self._handle).decode())

    def reset(self, t: float = 0.0) -> None:
        """Resets the controller with the present definition."""
        self._checked(self._core.hx_controller_reset(self._handle, self.definition.bytes, t))

    def change_gait(self, gait: Gait) -> None:
        """Changes the gait while the robot walks."""
        setup = replace(self._setup, gait=gait)
        for variable in load_controller_interface(setup).of_causality("parameter"):
            if variable.name.startswith("gait."):
                self.definition[variable.name] = variable.start
        self._checked(
            self._core.hx_controller_change_gait(self._handle, self.definition.bytes.gait)
        )

    def change_control(self, control: str) -> None:
        """Changes the control by name while the robot walks."""
        number = {"kinematic": 1, "compliant": 2, "paper": 3}[control]
        self.definition["control"] = number
        self._checked(self._core.hx_controller_change_control(self._handle, number))

    def output(self) -> Any:
        """Calculates the output for the present input and time."""
        self._core.hx_controller_output(self._handle, ct.byref(self.input), ct.byref(self.out))
        return self.out

    def go(self, t_end: float, *, rate: Any = None) -> None:
        """Steps to t_end [s] with the present input and its rate of change [1/s]."""
        self._checked(
            self._core.hx_controller_step(
                self._handle, ct.byref(self.input), None if rate is None else ct.byref(rate), t_end
            )
        )

    def sense(self, command: BodyCommand, measurement: Measurement) -> None:
        """Sets the input from command and measurement."""
        for name, _ in self.input.command._fields_:
            setattr(self.input.command, name, getattr(command, name))
        for name in ("angle", "foot_force"):
            np.ctypeslib.as_array(getattr(self.input, name))[...] = getattr(measurement, name)
        self.input.quaternion[:] = measurement.quaternion.tolist()

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> Any:
        """Returns the joint commands for [t, t + period) and steps over the period."""
        self.sense(command, measurement)
        out = self.output()
        self.go(t + self.period)
        return out

    @property
    def time(self) -> float:
        return float(self._core.hx_controller_time(self._handle))

    def save(self) -> bytes:
        """Returns the state."""
        state = ct.create_string_buffer(self._core.hx_controller_state_size())
        self._core.hx_controller_get_state(self._handle, state)
        return state.raw

    def restore(self, state: bytes) -> None:
        """Restores a state returned by save()."""
        self._checked(self._core.hx_controller_set_state(self._handle, state))


def commands(out: Any) -> np.ndarray:
    """Returns copies of angle_ref, speed_ref, torque_ref and acceleration_ref, shape (4, 6, 3)."""
    return np.array([np.ctypeslib.as_array(getattr(out, name)) for name in COMMANDS])
