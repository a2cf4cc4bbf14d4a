"""The virtual suspension: m z'' + b z' + k z = f per foot, f the normal force beyond the leg's preload, z up towards the torso.

The force is held over a period, so the discretisation by the matrix exponential is exact: x = (z, z'), x(k+1) = A x(k) + B f(k).
"""

from __future__ import annotations

from collections.abc import Sequence

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
    """Suspensions of all feet, in Python's own numbers. `state`: their deflections [m] and the rates of these [m/s]."""

    def __init__(self, gains: SuspensionGains, *, period: float) -> None:
        a, b = discretise(gains, period=period)
        self._transition = np.column_stack([a, b]).tolist()  # acts on (z, z', f)
        self._limit = gains.limit
        self.reset()

    def reset(self) -> None:
        """Relaxed and at rest."""
        self.state = [0.0] * LEGS, [0.0] * LEGS

    def step(self, force: Sequence[float]) -> tuple[list[float], list[float]]:
        """One period. force: of each leg, normal, beyond the preload [N]. Returns `state`: deflections and rates."""
        (a, b, c), (d, e, g) = self._transition
        legs = list(zip(*self.state, force, strict=True))
        z, rate = [a * p + b * v + c * f for p, v, f in legs], [d * p + e * v + g * f for p, v, f in legs]
        limit = self._limit
        if max(z) > limit or min(z) < -limit:
            # at its stop the suspension stands still
            rate = [0.0 if abs(p) > limit else v for p, v in zip(z, rate, strict=True)]
            z = [min(max(p, -limit), limit) for p in z]
        self.state = z, rate
        return self.state
