"""Represents planned forces on the feet, solves the systems that share them, and plans the loads
and contacts of one step, which the force laws compare with the sensors (C29). C: load_plan.h.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hexapod_cosim.controller.plane import Array, Mask, Plane, rows_of
from hexapod_cosim.controller.walk.gait_clock import GaitClock
from hexapod_cosim.controller.walk.inverse_dynamics import Demand

Vector = tuple[float, float, float]
RIDGE_SHARE = 1e-9  # 1    of the mean square arm: makes the system of feet on one line regular
LEAST_ARM = 1e-12  # m2    makes the system without any standing foot regular
LEAST_LOAD = 1e-6  # N    floor of the sum of loads that the shares are divided by


class Shares(NamedTuple):
    """Planned forces of the ground on the feet, walking frame, (6,) each."""

    activation: Array  # 1    in [0, 1]
    normal: Array  # N    vertical, never negative
    push: Plane  # N    horizontal, x + i y
    squeeze: Plane  # N    the part of `push` by which the legs squeeze each other (C42)

    def forces(self) -> Array:
        """Returns the forces (6, 3) [N]."""
        return rows_of(self.push.real, self.push.imag, self.normal)


def indentation(load: Any, stiffness: float) -> Any:
    """Returns the indentation [m] of the ground under loads [N], (f_n/K)^(2/3) (C21)."""
    return np.cbrt(load / stiffness) ** 2


def solve(system: Sequence[float], needed: tuple[float, float, float]) -> Vector:
    """Solves S x = b, S (3, 3) symmetric and positive semidefinite, by S = L D L^T.

    A ridge on the diagonal makes S definite. system: S_00, S_01, S_02, S_11, S_12, S_22.
    """
    s00, s01, s02, s11, s12, s22 = system
    ridge = RIDGE_SHARE * (s00 + s11 + s22) + LEAST_ARM
    d0, s11, s22 = s00 + ridge, s11 + ridge, s22 + ridge
    b0, b1, b2 = needed
    l10, l20 = s01 / d0, s02 / d0
    d1 = s11 - l10 * s01
    l21 = (s12 - l20 * s01) / d1
    d2 = s22 - l20 * s02 - l21 * l21 * d1
    y1 = b1 - l10 * b0
    y2 = b2 - l20 * b0 - l21 * y1
    x2 = y2 / d2
    x1 = y1 / d1 - l21 * x2
    return b0 / d0 - l10 * x1 - l20 * x2, x1, x2


class LoadPlan(NamedTuple):
    """Planned loads and contacts of one step; (6,) in the walking frame unless stated otherwise."""

    own: Array  # N m    (6, 3) torques for the legs' own weight and motion
    carry: Array  # N m    (6, 3) torques for the planned load
    shares: Shares
    feet: Plane  # m    contact points, x + i y
    weight: float  # N    scalar: of all shares
    standing: Mask  # the leg carries its whole share
    height: Array  # m    of the paths over their ends
    needed: float  # N m    scalar: the largest of `carry`
    swinging: Mask  # planned in the air
    awaited: Mask  # the gait clock waits for the foot
    descent: Array  # m    by which the feet come down in a period, at least 0


def plan_load(
    demand: Demand,
    shares: Shares,
    clock: GaitClock,
    *,
    active: bool,
    feet: Plane,
    height: Array,
    rise: Array,
    period: float,
) -> LoadPlan:
    """Returns the planned loads and contacts of a step.

    Args:
        demand: forces and torques that the planned motion needs.
        shares: planned forces on the feet.
        clock: of the gait, in the section of the step.
        active: the servos carry the load; otherwise all torques are 0.
        feet: (6,) contact points x + i y, walking frame [m].
        height, rise: (6,) of the paths over the stance [m, m/s].
        period: of the controller [s].
    """
    supports = 1.0 if active else 0.0
    carry = -supports * (demand.lever @ shares.forces()[:, :, None])[:, :, 0]
    return LoadPlan(
        own=supports * demand.torque,
        carry=carry,
        shares=shares,
        feet=feet,
        weight=float(shares.normal.sum()),
        standing=shares.activation >= 1.0,
        height=height,
        needed=float(np.abs(carry).max()),
        swinging=clock.swinging,
        awaited=clock.awaited,
        descent=np.maximum(-period * rise, 0.0),
    )
