"""Plans forces by which the standing legs squeeze each other. C: planned_squeeze.h.

Legs that squeeze each other support the torso like an arch: horizontal forces on the feet whose sum
and moment vanish carry a part of the femurs' load. They use friction, and a foot that uses more of
its friction slips more. The planned squeeze minimises a weighted sum of both, the squared torques
of all servos and the squared use of friction (C42), which has a closed form. `squeeze` in [0, 1) is
the weight: 0 plans no squeeze, and towards 1 the torques alone count. No foot is planned to use
more than a share of its friction (C43).
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.comply.load_plan import LEAST_LOAD, Shares, solve
from hexapod_cosim.controller.plane import Array, Plane, across, plane_of, square
from hexapod_cosim.controller.walk.inverse_dynamics import Demand

MOST_FRICTION = 0.7  # 1    share of its friction that a foot is planned to use at most
TRIPOD_SHARE = 1.0 / 3.0  # 1    of the weight: the load at which both sums are compared
LEAST_PUSH = 1e-12  # N    floor of a change of a force that a factor is divided by
Yielding = tuple[Array, Array, Array]  # xx, xy, yy of symmetric matrices, (6,) each


class PlannedSqueeze:
    """Computes the squeeze of one robot.

    friction: the coefficient of friction that is believed; weight: of the robot [N]; depth: of the
    ground below the torso's origin in the stance [m].
    """

    def __init__(self, *, friction: float, weight: float, depth: float) -> None:
        self.friction = friction
        self.torque = depth * TRIPOD_SHARE * weight  # N m    of a tripod's load at this arm

    def _yielding(self, lever: Array, normal: Array, price: float) -> Yielding:
        """Returns (J J^T + price/f_n^2)^-1 [1/m2], 0 without a load (C42).

        lever: (6, 3, 3) J^T [m]; normal: (6,) [N]; price: of the use of friction [N2 m2].
        """
        x, y, n = lever[:, :, 0], lever[:, :, 1], normal * normal
        xx = n * (x * x).sum(axis=1) + price
        xy = n * (x * y).sum(axis=1)
        yy = n * (y * y).sum(axis=1) + price
        part = n / (xx * yy - xy * xy)
        return part * yy, -part * xy, part * xx

    def _wanted(self, demand: Demand, normal: Array, yielding: Yielding) -> Plane:
        """Returns the horizontal forces (6,) [N] that each leg by itself would choose."""
        lever, (xx, xy, yy) = demand.lever, yielding
        left = demand.torque - lever[:, :, 2] * normal[:, None]  # for the horizontal forces
        gx, gy = (lever[:, :, 0] * left).sum(axis=1), (lever[:, :, 1] * left).sum(axis=1)
        return plane_of(xx * gx + xy * gy, xy * gx + yy * gy)

    def _balance(self, change: Plane, arm: Plane, yielding: Yielding) -> Plane:
        """Returns changes of forces (6,) without their sum and their moment, by multipliers.

        arm: (6,) of the feet about the centre of load [m].
        """
        (xx, xy, yy), x, y = yielding, arm.real, arm.imag
        tx, ty = xy * x - xx * y, yy * x - xy * y
        turning, twists = ty * x - tx * y, across(arm, change)
        *system, twist = np.array((xx, xy, tx, yy, ty, turning, twists)).sum(axis=1).tolist()
        total = change.sum()
        a, b, c = solve(system, (total.real, total.imag, twist))
        carried = plane_of(xx * a + xy * b + tx * c, xy * a + yy * b + ty * c)
        return change - carried

    def _limit(self, shares: Shares, change: Plane) -> float:
        """Returns the factor on all changes (6,) that keeps each foot within its friction (C43)."""
        normal = shares.normal
        room = MOST_FRICTION * self.friction * normal - np.sqrt(square(shares.push))
        factor = room / np.maximum(np.sqrt(square(change)), LEAST_PUSH)
        return max(float(factor[normal > LEAST_LOAD].min(initial=1.0)), 0.0)

    def add(self, feet: Plane, demand: Demand, shares: Shares, squeeze: float) -> Shares:
        """Returns shares with the squeeze added; the sums of forces and moments stay.

        Args:
            feet: (6,) contact points x + i y, walking frame [m].
            demand: torques and levers of the planned motion.
            shares: without squeeze (C19, C20).
            squeeze: weight of the torques, in [0, 1).
        """
        if not squeeze > 0.0 or not self.friction > 0.0:
            return shares
        normal, used = shares.normal, self.torque / self.friction
        price = (1.0 / squeeze - 1.0) * used * used
        arm = feet - (normal @ feet) / max(normal.sum(), LEAST_LOAD)
        yielding = self._yielding(demand.lever, normal, price)
        wanted = self._wanted(demand, normal, yielding)
        change = self._balance(wanted - shares.push, arm, yielding)
        change = self._limit(shares, change) * change
        return shares._replace(push=shares.push + change, squeeze=change)
