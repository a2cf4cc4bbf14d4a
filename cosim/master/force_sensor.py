"""Models the feet's force sensors with noise, delay and faults.

Contacts are derived from forces, so noise does not change them but delay and faults do. A sensor
that reads NaN shows no contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.master.faulty_sensors import FaultySensors
from hexapod_cosim.cosim.scenario.schedule import SensorFaults
from hexapod_cosim.models import LEG_NAMES

NO_CONTACT = (0.0, 0.0, 0.0, 0.0)  # N, N, N, contact
NO_NUMBERS = (np.nan, np.nan, np.nan, 0.0)


@dataclass(frozen=True, kw_only=True)
class SensorSettings:
    """Errors of the feet's force sensors. Faults apply after noise and delay."""

    noise: float = 0.0  # 1    standard deviation, as a share of the force
    seed: int = 0  # of the noise
    delay: int = 0  # macro-steps; until the first delayed reading, the first reading holds
    faults: SensorFaults | None = None


def noise_factors(settings: SensorSettings, count: int) -> NDArray[np.float64] | None:
    """Returns the noise of `count` macro-steps as factors (count, 6, 3) on the forces.

    These are the numbers that `ForceSensor` draws. Returns None without noise.
    """
    if not settings.noise:
        return None
    return 1.0 + settings.noise * np.random.default_rng(settings.seed).standard_normal(
        (count, len(LEG_NAMES), 3)
    )


class ForceSensor:
    """Turns true forces and contacts into readings, once per macro-step.

    Attributes, which `read` updates: force (6, 3) [N] ground on foot, world axes; contact (6,).
    """

    def __init__(self, settings: SensorSettings) -> None:
        delay, legs = settings.delay, len(LEG_NAMES)
        self.force, self.contact = np.zeros((legs, 3)), np.zeros(legs, dtype=np.bool_)
        self._forces = np.zeros((delay + 1, legs, 3))  # ring buffers of the last readings
        self._contacts = np.zeros((delay + 1, legs), dtype=np.bool_)
        self._noise, faults = settings.noise, settings.faults
        self._faulty = None if faults is None else FaultySensors(faults, NO_CONTACT, NO_NUMBERS)
        self._generator = np.random.default_rng(settings.seed)
        self._count = 0

    def read(self, force: NDArray[np.float64], contact: NDArray[np.int32]) -> None:
        """Updates the readings for the next macro-step from the true force (6, 3) [N] and
        contact (6,).
        """
        forces, contacts, k = self._forces, self._contacts, self._count
        newest, oldest = k % len(forces), (k + 1) % len(forces)
        forces[newest], contacts[newest] = force, contact
        if self._noise:
            forces[newest] *= 1.0 + self._noise * self._generator.standard_normal(force.shape)
        if k == 0:
            forces[:], contacts[:] = forces[0], contacts[0]
        self._apply_faults(forces[oldest], contacts[oldest])
        self._count = k + 1

    def _apply_faults(self, force: NDArray[np.float64], contact: NDArray[np.bool_]) -> None:
        if self._faulty is None:
            self.force[...], self.contact[...] = force, contact
            return
        self._faulty.read(np.column_stack([force, contact]))
        self.force[...] = self._faulty.reading[:, :3]
        self.contact[...] = self._faulty.reading[:, 3] != 0.0
