"""The feet's force sensors as they are: noisy, late, now and then broken. Contacts are derived
from forces and share their fate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.scenario.records import FAULTS
from hexapod_cosim.models import LEG_NAMES

DEAD, STUCK = (FAULTS.index(name) + 1 for name in ("dead", "stuck"))


@dataclass(frozen=True, kw_only=True)
class SensorSettings:
    """All that is wrong with the feet's force sensors. A fault is what comes out last, after
    noise and delay.
    """

    noise: float = 0.0  # 1    standard deviation, as a share of the force
    seed: int = 0  # of the noise
    delay: int = 0  # whole macro-steps by which readings are late; before them the first one holds
    faults: NDArray[np.int8] | None = (
        None  # (steps + 1, 6) numbers of FAULTS from 1, 0 none, step by step
    )


def noise_factors(settings: SensorSettings, count: int) -> NDArray[np.float64] | None:
    """(count, 6, 3) what the forces of so many macro-steps are multiplied by, as `ForceSensor`
    draws it; None without noise.
    """
    if not settings.noise:
        return None
    return 1.0 + settings.noise * np.random.default_rng(settings.seed).standard_normal(
        (count, len(LEG_NAMES), 3)
    )


class ForceSensor:
    """Turns true forces and contacts into readings, once a macro-step.

    Attributes: force: (6, 3) [N] ground on foot, world axes;  contact: (6,). Both are brought up to
    date by `read`.
    """

    def __init__(self, settings: SensorSettings) -> None:
        delay, legs = settings.delay, len(LEG_NAMES)
        self.force, self.contact = np.zeros((legs, 3)), np.zeros(legs, dtype=np.bool_)
        self._forces, self._contacts = (
            np.zeros((delay + 1, legs, 3)),
            np.zeros((delay + 1, legs), dtype=np.bool_),
        )
        self._noise, self._generator, self._faults = (
            settings.noise,
            np.random.default_rng(settings.seed),
            settings.faults,
        )
        self._count = 0

    def read(self, force: NDArray[np.float64], contact: NDArray[np.int32]) -> None:
        """The readings of the next macro-step, from what is true now."""
        forces, contacts, k = self._forces, self._contacts, self._count
        newest, oldest = k % len(forces), (k + 1) % len(forces)
        forces[newest], contacts[newest] = force, contact
        if self._noise:
            forces[newest] *= 1.0 + self._noise * self._generator.standard_normal(force.shape)
        if k == 0:
            forces[:], contacts[:] = forces[0], contacts[0]
        self._show(forces[oldest], contacts[oldest])
        self._count = k + 1

    def _show(self, force: NDArray[np.float64], contact: NDArray[np.bool_]) -> None:
        if self._faults is None:
            self.force[...], self.contact[...] = force, contact
            return
        fault = self._faults[self._count]
        alive, dead = (fault != STUCK) | (self._count == 0), fault == DEAD
        self.force[alive], self.contact[alive] = force[alive], contact[alive]
        self.force[dead], self.contact[dead] = 0.0, False
