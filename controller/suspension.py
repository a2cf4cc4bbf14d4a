"""The virtual suspension: m z'' + b z' + k z = f per foot, f the normal force beyond the leg's preload, z up towards the torso.

The force is held over a period, so the discretisation by the matrix exponential is exact: x = (z, z'), x(k+1) = A x(k) + B f(k).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from hexapod_cosim.controller.gains import SuspensionGains
from hexapod_cosim.controller.kinematics import LEGS, Array


def discretise(gains: SuspensionGains, *, period: float) -> tuple[Array, Array]:
    """A (2, 2) and B (2,) of the suspension under a force held for a period [s]."""
    system = np.zeros((3, 3))
    system[0, 1] = 1.0
    system[1] = np.array([-gains.stiffness, -gains.damping, 1.0]) / gains.mass
    step = expm(system * period)
    return step[:2, :2].copy(), step[:2, 2].copy()


class Suspension:
    """Suspensions of all feet. `state` (2, 6): deflection [m] and its rate [m/s]."""

    def __init__(self, gains: SuspensionGains, *, period: float) -> None:
        a, b = discretise(gains, period=period)
        self._transition = np.column_stack([a, b])  # (2, 3): acts on (z, z', f)
        self._limit = gains.limit
        self._stacked = np.zeros((3, LEGS))
        self.state = np.zeros((2, LEGS))

    def reset(self) -> None:
        """Relaxed and at rest."""
        self.state[:] = 0.0

    def step(self, force: Array) -> Array:
        """One period. force: (6,) normal force beyond the preload [N]. Returns `state`: deflection and rate (2, 6)."""
        state, stacked = self.state, self._stacked
        stacked[:2], stacked[2] = state, force
        np.dot(self._transition, stacked, out=state)
        z, rate = state
        reached = z.tolist()
        if max(reached) > self._limit or min(reached) < -self._limit:
            # at its stop the suspension stands still
            rate[np.abs(z) > self._limit] = 0.0
            np.maximum(z, -self._limit, out=z)
            np.minimum(z, self._limit, out=z)
        return state
