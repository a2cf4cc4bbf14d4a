"""The virtual suspension: m z'' + b z' + k z = f per foot, f the normal force beyond the leg's
share, z up towards the torso.

The force is held over a period, so the discretisation by the matrix exponential is exact: x = (z,
z'), x(k+1) = A x(k) + B f(k).
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.gains import SuspensionGains
from hexapod_cosim.controller.kinematics import Array


def discretise(gains: SuspensionGains, *, period: float) -> tuple[Array, Array]:
    """A (2, 2) and B (2,) of the suspension under a force held for a period [s]."""
    from scipy.linalg import expm  # noqa: PLC0415  slow to import

    system = np.zeros((3, 3))
    system[0, 1] = 1.0
    system[1] = np.array([-gains.stiffness, -gains.damping, 1.0]) / gains.mass
    step = expm(system * period)
    return step[:2, :2].copy(), step[:2, 2].copy()
