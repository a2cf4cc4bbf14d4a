"""Applies faults to the readings of sensors: lost, frozen, NaN and late readings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.scenario.records import FAULTS
from hexapod_cosim.cosim.scenario.schedule import SensorFaults
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES

DEAD, STUCK, NAN, LATE = (FAULTS.index(name) + 1 for name in ("dead", "stuck", "nan", "late"))
LEVEL_AT_REST = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # quaternion, rotation rate [rad/s]


class FaultySensors:
    """Turns true readings of n sensors into those with faults, once per macro-step.

    `dead`: the numbers (m,) that a dead sensor reads; `nan`: those of a sensor that reads NaN.

    Attribute: `reading` (n, m), which `read` updates.
    """

    def __init__(self, faults: SensorFaults, dead: Sequence[float], nan: Sequence[float]) -> None:
        count, longest = faults.kind.shape[1], int(faults.delay.max())
        self.reading = np.zeros((count, len(dead)))
        self._faults, self._dead, self._nan = faults, np.array(dead), np.array(nan)
        self._ring = np.zeros((longest + 1, count, len(dead)))  # of the last true readings
        self._sensors = np.arange(count)
        self._count = 0

    def read(self, true: NDArray[np.float64]) -> None:
        """Updates the readings for the next macro-step from the true ones (n, m)."""
        ring, k = self._ring, self._count
        ring[k % len(ring)] = true
        kind = self._faults.kind[k]
        delay = np.minimum(np.where(kind == LATE, self._faults.delay[k], 0), k)
        alive = (kind != STUCK) | (k == 0)
        self.reading[alive] = ring[(k - delay) % len(ring), self._sensors][alive]
        self.reading[kind == DEAD] = self._dead
        self.reading[kind == NAN] = self._nan
        self._count = k + 1


class InnerSensors:
    """Sensors of joints and attitude with faults.

    Attributes, which `read` updates: angle [rad] and speed [rad/s] (6, 3) of the joints, quaternion
    (4,) and angular_velocity (3,) [rad/s] of the torso. A sensor without faults reads the truth.
    """

    def __init__(self, angle: SensorFaults | None, attitude: SensorFaults | None) -> None:
        joints = len(LEG_NAMES), len(JOINT_NAMES)
        self.angle, self.speed = np.zeros(joints), np.zeros(joints)
        self.quaternion, self.angular_velocity = np.zeros(4), np.zeros(3)
        no_numbers = [np.nan] * len(LEVEL_AT_REST)
        self._joints = None if angle is None else FaultySensors(angle, (0.0, 0.0), no_numbers[:2])
        self._torso = (
            None if attitude is None else FaultySensors(attitude, LEVEL_AT_REST, no_numbers)
        )

    def read(
        self,
        angle: NDArray[np.float64],
        speed: NDArray[np.float64],
        quaternion: NDArray[np.float64],
        angular_velocity: NDArray[np.float64],
    ) -> None:
        """Updates the readings for the next macro-step from the true values, of the same shapes."""
        if self._joints is not None:
            self._joints.read(np.stack([angle.ravel(), speed.ravel()], axis=1))
            readings = self._joints.reading
            angle, speed = (readings[:, k].reshape(angle.shape) for k in (0, 1))
        if self._torso is not None:
            self._torso.read(np.concatenate([quaternion, angular_velocity])[None])
            quaternion, angular_velocity = np.split(self._torso.reading[0], [4])
        self.angle[...], self.speed[...] = angle, speed
        self.quaternion[...], self.angular_velocity[...] = quaternion, angular_velocity
