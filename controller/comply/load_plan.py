"""Plans loads and contacts of one step, which the force laws compare with the sensors (C29).

C: load_plan.h.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.comply.shares import Shares
from hexapod_cosim.controller.plane import Array, Mask, Plane
from hexapod_cosim.controller.walk.inverse_dynamics import Demand


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
    overspeed: bool  # scalar: the plan exceeds the speed limit of some joint


def plan_load(
    demand: Demand,
    shares: Shares,
    *,
    active: bool,
    feet: Plane,
    height: Array,
    rise: Array,
    swinging: Mask,
    awaited: Mask,
    overspeed: bool,
    period: float,
) -> LoadPlan:
    """Returns the planned loads and contacts of a step.

    Args:
        demand: forces and torques that the planned motion needs.
        shares: planned forces on the feet.
        active: the servos carry the load; otherwise all torques are 0.
        feet: (6,) contact points x + i y, walking frame [m].
        height, rise: (6,) of the paths over the stance [m, m/s].
        swinging: (6,) legs planned in the air.
        awaited: (6,) feet that the gait clock waits for.
        overspeed: the plan exceeds the speed limit of some joint.
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
        swinging=swinging,
        awaited=awaited,
        descent=np.maximum(-period * rise, 0.0),
        overspeed=overspeed,
    )
