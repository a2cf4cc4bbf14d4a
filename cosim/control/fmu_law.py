"""Drives a controller FMU, ours or a foreign one, as a controller of the Python master.

At a communication point t the master sets the FMU's inputs, gets its outputs, which hold in the
plant from t on, and steps the FMU to t + h. Outputs that the FMU computes in its step alone are
therefore one macro-step late, as with any other importer. Inputs are also set in initialisation
mode, so that an FMU can compute its first outputs from them.

Stance and gait of the FMU are read from its model description.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import PATTERNS, BodyCommand, Diagnostics, JointCommand, Measurement
from hexapod_cosim.cosim.common.files import file_stamp
from hexapod_cosim.cosim.control.fmu_instance import Block3, ControllerFmu3
from hexapod_cosim.cosim.interface.descriptions import open_description
from hexapod_cosim.cosim.interface.names import JOINTS, LEGS, joint_names
from hexapod_cosim.cosim.master.connection import (
    DIAGNOSED,
    DIAGNOSED_FLAGS,
    FLAGS,
    SINKS,
    SOURCES,
    Connection,
    Pairs,
    connect,
)
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.master.fmu_block import FmuBlock
from hexapod_cosim.models import FmuError
from hexapod_cosim.models.arrays import Vector3

REFERENCES = 4  # angle, speed, torque, acceleration
ARRAY = "stance"  # of FMI 3: six legs by three joints
NAMES = joint_names(ARRAY)
TIMING = ("gait.pattern", "gait.period", "gait.duty")
MAX_READ = 32  # files that are kept; the least recently used one goes first


class FmuLaw:
    """Steps a controller FMU through its connection; `period` [s] is the length of its steps."""

    def __init__(self, fmu: Fmu | ControllerFmu3, connection: Connection, *, period: float) -> None:
        self._fmu, self._period = fmu, period
        self._inputs = [
            _Wire(fmu, pairs, SOURCES)
            for pairs in (connection.inputs, connection.flag_inputs)
            if pairs
        ]
        self._output = _Wire(fmu, connection.outputs, SINKS)
        self._row = np.zeros(len(SINKS))
        parts = self._row.reshape(REFERENCES, LEGS, JOINTS)
        self._out = JointCommand(*parts)
        self.diagnostics: Diagnostics | None = None
        self._shown: list[tuple[_Wire, NDArray[np.float64]]] = []
        if connection.diagnostics and connection.flags:
            self._show_diagnostics(connection)
        self._unconnected = connection.unconnected

    def _show_diagnostics(self, connection: Connection) -> None:
        """Makes the arrays of diagnostics that each step fills."""
        info = np.zeros(len(DIAGNOSED))
        self._marks = np.zeros(len(DIAGNOSED_FLAGS))
        self._shown = [
            (_Wire(self._fmu, connection.diagnostics, DIAGNOSED), info),
            (_Wire(self._fmu, connection.flags, DIAGNOSED_FLAGS), self._marks),
        ]
        shifts, lifts, feet = np.split(info, [2 * LEGS, 3 * LEGS])
        self._flags = np.zeros((len(FLAGS), LEGS), dtype=np.bool_)
        swinging, unreachable, fallback, absent, outrun, doubted, *_ = self._flags
        self.diagnostics = Diagnostics(
            swinging, feet.reshape(LEGS, 3), shifts.view(np.complex128), lifts, unreachable,
            fallback, absent, outrun, doubted, self._flags[-JOINTS:],
        )  # fmt: skip

    @property
    def warnings(self) -> tuple[str, ...]:
        """Tells which inputs of the FMU nothing is connected to."""
        if not self._unconnected:
            return ()
        names = ", ".join(self._unconnected)
        return (f"inputs of {self._fmu.path.name} keep their start values: {names}",)

    def start(self, t: float, stop: float, command: BodyCommand, measured: Measurement) -> None:
        """Initialises the FMU at time t [s] with the plant's first outputs. Raises FmuError."""
        self._fmu.initialise(t, stop, lambda: self._write(command, measured))

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for [t, t + period). Raises FmuError.

        The next step reuses the arrays of the result.
        """
        self._write(command, measurement)
        self._output.read_into(self._row)
        if not np.isfinite(self._row).all():
            name = SINKS[int(np.argmin(np.isfinite(self._row)))]
            raise FmuError(
                "an output of the controller FMU is not finite",
                got=name,
                expected=f"finite numbers at {t:g} s",
                where=self._fmu.path.name,
            )
        for wire, row in self._shown:
            wire.read_into(row)
        if self._shown:
            self._flags[...] = self._marks.reshape(self._flags.shape)
        self._fmu.step(t, self._period)
        return self._out

    def _write(self, command: BodyCommand, measurement: Measurement) -> None:
        """Writes the connected inputs."""
        row = source_row(command, measurement)
        for wire in self._inputs:
            wire.write_from(row)


def law_of_ours(fmu: Fmu | ControllerFmu3, *, period: float) -> FmuLaw:
    """Returns the driver of a controller FMU whose variables have our names."""
    connection = connect(fmu.described, {}, torque=False, where=str(fmu.path))
    return FmuLaw(fmu, connection, period=period)


class _Wire:
    """Copies the elements of connected variables between a block and a row of our names."""

    def __init__(self, fmu: Fmu | ControllerFmu3, pairs: Pairs, ours: list[str]) -> None:
        index = {name: k for k, name in enumerate(ours)}
        self._block: FmuBlock | Block3 = fmu.block([name for name, _ in pairs])
        self._places = np.array([index[name] for _, names in pairs for name in names], dtype=int)

    def read_into(self, row: NDArray[np.float64]) -> None:
        """Reads the variables from the FMU into their places of a row. Raises FmuError."""
        self._block.get()
        row[self._places] = self._block.values

    def write_from(self, row: NDArray[np.float64]) -> None:
        """Writes the variables from their places of a row to the FMU. Raises FmuError."""
        self._block.values[:] = row[self._places]
        self._block.set()


def source_row(command: BodyCommand, measurement: Measurement) -> NDArray[np.float64]:
    """Returns command and measurement in the order of SOURCES."""
    return np.concatenate(
        [
            astuple(command),
            measurement.angle.ravel(),
            measurement.speed.ravel(),
            measurement.foot_force.ravel(),
            measurement.quaternion,
            measurement.angular_velocity,
            measurement.contact,
        ]
    )


@dataclass(frozen=True)
class StanceAndGait:
    """Stance and gait of a controller FMU."""

    stance: tuple[Vector3, ...] | None  # rad  by leg and joint; None: it has none
    gait: Mapping[str, Any]  # arguments of make_gait(); empty: it has none


def stance_and_gait(path: Path) -> StanceAndGait:
    """Returns stance and gait of a controller FMU.

    The angles of the stance are the start values of its parameters `{leg}.{joint}.stance`, or of
    the array `stance` of an FMU of FMI 3.0. The gait is read from those of gait.pattern,
    gait.period and gait.duty. Raises FmuError for a file that is no FMU.
    """
    return _read(path, *(file_stamp(path) if path.is_file() else (0, 0)))


@lru_cache(maxsize=MAX_READ)
def _read(path: Path, _changed: int, _size: int) -> StanceAndGait:
    """Returns those of a file with this stamp."""
    starts = {
        variable.name: variable.start
        for variable in open_description(path).modelVariables
        if variable.causality == "parameter"
    }
    named = [starts.get(name) for name in NAMES]
    angles = _numbers(named) or _numbers(str(starts.get(ARRAY)).split())
    stance = None
    if len(angles) == len(NAMES):
        stance = tuple(zip(angles[0::3], angles[1::3], angles[2::3], strict=True))
    return StanceAndGait(stance, _gait(_numbers([starts.get(name) for name in TIMING])))


def _gait(timing: tuple[float, ...]) -> dict[str, Any]:
    """Returns the arguments of make_gait() from the numbers of TIMING."""
    if not timing:
        return {}
    number, period, duty = timing
    names = dict(enumerate(PATTERNS, start=1))
    if number not in names or not (period > 0.0 and 0.0 < duty < 1.0):
        return {}  # a pattern of its own, or numbers that are no gait
    return {"name": names[int(number)], "period": period, "duty": duty}


def _numbers(texts: list[Any]) -> tuple[float, ...]:
    """Returns finite numbers from their texts; () if one of them is none."""
    try:
        numbers = tuple(float(text) for text in texts)
    except (TypeError, ValueError):
        return ()
    return numbers if all(map(math.isfinite, numbers)) else ()
