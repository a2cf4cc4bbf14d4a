"""Errors of sensors: noise, delay and faults (cosim/master/src/sensors.c).

The C functions serve both loops. Contacts are derived from forces, so noise does not change them
but delay and faults do.
"""

from __future__ import annotations

import ctypes as ct
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import (
    LEGS,
    foot_names,
    foot_vector_names,
    joint_names,
    vector_names,
)
from hexapod_cosim.cosim.master.loop_library import loop_header, master_library
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.schedule import Schedule, SensorFaults

ROUND_OFF = 1e-6  # of a macro-step, in a delay
MEASURED = {
    "angle": joint_names("angle"),
    "speed": joint_names("speed"),
    "foot_force": foot_vector_names("force"),
    "quaternion": vector_names("torso.quaternion", 4),
    "angular_velocity": vector_names("torso.angular_velocity"),
}
CONTACT = foot_names("contact")
READINGS = [*(name for names in MEASURED.values() for name in names), *CONTACT]
# the sensors of each kind, and what they read when they are dead or read no numbers
FEET = [[*MEASURED["foot_force"][3 * k : 3 * k + 3], CONTACT[k]] for k in range(LEGS)]
ENCODERS = [list(pair) for pair in zip(MEASURED["angle"], MEASURED["speed"], strict=True)]
TORSO = [[*MEASURED["quaternion"], *MEASURED["angular_velocity"]]]
NO_CONTACT = (0.0, 0.0, 0.0, 0.0), (np.nan, np.nan, np.nan, 0.0)
NO_MOTION = (0.0, 0.0), (np.nan, np.nan)
LEVEL_AT_REST = (1.0, *6 * (0.0,)), 7 * (np.nan,)  # quaternion, rotation rate [rad/s]


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Errors of the sensors of a run. Faults apply after noise and delay."""

    noise: float = 0.0  # 1    of the forces: standard deviation, as a share of the force
    seed: int = 0  # of the noise
    delay: int = 0  # macro-steps; of the forces
    feet: SensorFaults | None = None
    joints: SensorFaults | None = None
    torso: SensorFaults | None = None
    moments: int = 0  # of the run


def errors_of(scenario: Scenario, schedule: Schedule) -> Errors:
    """Returns the errors of a scenario."""
    sensors = scenario.sensors
    return Errors(
        noise=sensors.foot_force_noise,
        seed=scenario.seed,
        delay=math.ceil(sensors.foot_force_delay / scenario.macro_step - ROUND_OFF),
        feet=schedule.faults,
        joints=schedule.angle_faults,
        torso=schedule.attitude_faults,
        moments=len(schedule.times),
    )


class Sensors:
    """Sensors with errors, on a row of values of one run.

    Attributes: `feet`, `joints` and `torso`, structures for C; `measured`, the index in
    the row of each of READINGS: that of the true value where a sensor has no errors.

    Args:
        errors: of the run.
        places: indices in the row by name, of READINGS.
        first: index in the row of the first of READINGS as sensors read them.
    """

    def __init__(self, errors: Errors, places: Mapping[str, int], first: int) -> None:
        self._arrays: list[NDArray[Any]] = []  # keeps alive what the structures point to
        self._places, self._first = places, first
        self.measured = {name: places[name] for name in READINGS}
        factor, noise = None, np.full((max(errors.moments, 1), LEGS), errors.noise)
        if errors.feet is not None:
            noise += errors.feet.noise
        if noise.any():
            normal = np.random.default_rng(errors.seed).standard_normal((*noise.shape, 3))
            factor = 1.0 + noise[:, :, None] * normal
        moments = errors.moments
        self.feet = self._make(FEET, errors.feet, NO_CONTACT, moments, factor, errors.delay)
        self.joints = self._make(ENCODERS, errors.joints, NO_MOTION, moments)
        self.torso = self._make(TORSO, errors.torso, LEVEL_AT_REST, moments)
        # without errors there is nothing to call
        self._sensors = [ct.byref(one) for one in (self.feet, self.joints, self.torso) if one.count]

    def _keep(self, values: Any, dtype: Any) -> int:
        """Returns the address of an array that lives as long as this object."""
        array = np.ascontiguousarray(values, dtype=dtype)
        self._arrays.append(array)
        return int(array.ctypes.data)

    def _make(
        self,
        names: Sequence[Sequence[str]],
        faults: SensorFaults | None,
        faulty: tuple[Sequence[float], Sequence[float]],
        moments: int,
        factor: NDArray[np.float64] | None = None,
        delay: int = 0,
    ) -> Any:
        """Returns the structure of sensors of one kind; one of no sensors without errors."""
        make = loop_header().types["hxSensors"]
        if faults is None and factor is None and not delay:
            return make()
        count, size, slots = len(names), len(names[0]), delay + 1
        given: dict[str, Any] = {}
        if faults is not None:
            slots += int(faults.delay.max())
            given = {
                "fault": self._keep(faults.kind, np.int8),
                "late": self._keep(faults.delay, np.int32),
            }
        if factor is not None:
            given |= {"factor": self._keep(factor, np.float64), "noisy": factor.shape[-1]}
        readings = {name: self._first + READINGS.index(name) for sensor in names for name in sensor}
        true = [self._places[name] for name in readings]
        self.measured |= readings
        return make(
            count=count, size=size, delay=delay, moments=moments, slots=slots,
            place=self._keep(true, np.uintp), reading=self._keep([*readings.values()], np.uintp),
            dead=self._keep(faulty[0], np.float64), nan=self._keep(faulty[1], np.float64),
            memory=self._keep(np.zeros((slots, count, size)), np.float64), **given,
        )  # fmt: skip

    def read(self, moment: int, row: NDArray[np.float64]) -> None:
        """Computes the readings in the row after `moment` macro-steps."""
        for sensors in self._sensors:
            master_library().hx_sensors_read(sensors, moment, row.ctypes.data)
