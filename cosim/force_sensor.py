"""The feet's force sensors as they are: noisy, late, now and then broken. Contacts are derived from forces and share their fate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.scenario_records import FAULTS
from hexapod_cosim.models import LEG_NAMES

DEAD, STUCK = (FAULTS.index(name) + 1 for name in ("dead", "stuck"))


class ForceSensor:
    """Turns true forces and contacts into readings, once a macro-step.

    Args:
        noise: standard deviation, as a share of the force.
        seed: of the noise.
        delay: whole macro-steps by which readings are late; before them the first one holds.
        faults: (steps + 1, 6) numbers of FAULTS from 1, 0 none, step by step; a fault is what comes out last, after noise and delay.

    Attributes: force: (6, 3) [N] ground on foot, world axes;  contact: (6,). Both are brought up to date by `read`.
    """

    def __init__(self, *, noise: float = 0.0, seed: int = 0, delay: int = 0, faults: NDArray[np.int8] | None = None) -> None:
        legs = len(LEG_NAMES)
        self.force, self.contact = np.zeros((legs, 3)), np.zeros(legs, dtype=np.bool_)
        self._forces, self._contacts = np.zeros((delay + 1, legs, 3)), np.zeros((delay + 1, legs), dtype=np.bool_)
        self._noise, self._generator, self._faults = noise, np.random.default_rng(seed), faults
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
