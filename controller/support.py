"""Who carries what: the planned weight and acceleration of the robot, shared out over the standing
feet.

The ground must give the robot the force and the moment that its planned motion demands
(inverse_dynamics.py). The feet's shares are

    f_n = a (alpha + beta x + gamma y)       sum f_n = F_z     sum p f_n = moment     p = x + i y
    f_h = (f_n / sum f_n) (F_h + i w (p - c))      c = sum p f_n / sum f_n      w such that sum
    Im(p^* f_h) = twist

with the least sum of f_n^2/a that does it, so that no foot squeezes another, a in [0, 1] each leg's
activation: 1 while it stands, 0 in the air, and in between over the hand-over, which lies half
before and half after the moment at which the paths say that one foot lifts off and the next has
landed. The servos are told the torques -J^T f that balance the shares, so that no leg sags under
its load; and as the ground gives way by delta = (f_n/K)^(2/3), a foot is lowered by what it will
press in more than in the stance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.controller.gains import SupportGains
from hexapod_cosim.controller.gait import Gait
from hexapod_cosim.controller.inverse_dynamics import Demand
from hexapod_cosim.controller.kinematics import LEGS, Array, Mask, Plane
from hexapod_cosim.models import Robot

RIDGE = 1e-9  # 1    of the mean square arm: feet on one line share no moment about it
LEAST_ARM = 1e-12  # m2    keeps the equations of no standing foot at all solvable
LEAST_SPREAD = 1e-4  # m2    of the feet about their centre: less takes no moment about the vertical
LEAST_LOAD = 1e-6  # N    less is no load to share by


@dataclass(frozen=True)
class Shares:
    """Planned forces of the ground on the feet, walking frame; rows are steps."""

    activation: Array  # 1    (n, 6)
    normal: Array  # N    (n, 6)
    push: Plane  # N    (n, 6) x + i y

    def forces(self, at: int) -> Array:
        """(6, 4) of one step: rows x y z 0."""
        push = self.push[at]
        return np.stack([push.real, push.imag, self.normal[at], np.zeros(LEGS)], axis=-1)

    def rows(self, chosen: slice) -> Shares:
        """Some of the steps."""
        return Shares(self.activation[chosen], self.normal[chosen], self.push[chosen])


class Support:
    """Hand-over and shares of one gait on one robot."""

    def __init__(self, robot: Robot, gait: Gait, gains: SupportGains, *, rest: Demand) -> None:
        """rest: what the robot asks for in its stance, one step."""
        self._gait, self._stiffness, self._still = gait, robot.contact.stiffness, rest
        # hand-overs of a leg never overlap, whatever the gait
        self._handover = min(
            gains.handover_time / gait.period, gait.duty, 1.0 - gait.duty
        )  # cycles
        self._rest = self.indentation(rest.weight / LEGS)

    def indentation(self, load: Array) -> Array:
        """m    (f_n/K)^(2/3) of loads [N]"""
        return np.asarray(np.cbrt(load / self._stiffness) ** 2)

    def lowering(self, feet: Plane, activation: Array) -> Array:
        """m    (n, 6) how much lower than planned the feet must be for the torso to keep its
        height over the ground that gives way
        """
        return self.indentation(self.normal(feet, activation, self._still)) - self._rest

    def activation(self, phase: Array, stayed: Mask, stays: Mask, *, walking: bool) -> Array:
        """(n, 6) in [0, 1] at gait phases (n, 6).

        stayed, stays: (6,) these legs had nowhere to step when they were to lift off last, or will
        have nowhere to when they are next.
        """
        if not walking:
            return np.ones_like(phase)
        half = 0.5 * self._handover
        since = (phase + half) % 1.0  # cycles since the activation began to rise
        rising, falling = (
            _smooth(since / self._handover),
            _smooth((self._gait.duty + 2.0 * half - since) / self._handover),
        )
        # a leg that stayed where it was has neither given up its load nor takes it up again
        handing = np.minimum(np.where(stayed, 1.0, rising), np.where(stays, 1.0, falling))
        return np.where(stayed & (phase >= self._gait.duty), 1.0, handing)

    def shares(self, feet: Plane, activation: Array, demand: Demand) -> Shares:
        """Shares of feet (n, 6) x + i y in the walking frame."""
        normal = self.normal(feet, activation, demand)
        part = normal / np.maximum(normal.sum(axis=1), LEAST_LOAD)[:, None]
        centre = (part * feet).sum(axis=1)
        arm = feet - centre[:, None]
        spread = (part * (arm.real**2 + arm.imag**2)).sum(axis=1)
        turn = (demand.twist - (centre.conj() * demand.push).imag) / np.maximum(spread, LEAST_ARM)
        turn[spread < LEAST_SPREAD] = 0.0
        return Shares(activation, normal, part * (demand.push[:, None] + 1j * turn[:, None] * arm))

    def normal(self, feet: Plane, activation: Array, demand: Demand) -> Array:
        """(n, 6) the vertical shares [N], never negative; the demand is of as many steps, or of
        one that holds for all.
        """
        one = np.stack([np.ones(feet.shape), feet.real, feet.imag], axis=-1)  # (n, 6, 3)
        weighted = one * activation[..., None]
        square = weighted.transpose(0, 2, 1) @ one
        ridge = RIDGE * np.trace(square, axis1=1, axis2=2) + LEAST_ARM
        needed = np.stack([demand.weight, demand.moment.real, demand.moment.imag], axis=-1)[
            ..., None
        ]
        return np.maximum(
            (weighted @ np.linalg.solve(square + ridge[:, None, None] * np.eye(3), needed))[..., 0],
            0.0,
        )


def torques(lever: Array, shares: Shares) -> Array:
    """(n, 6, 3) -J^T f [N m] of planned forces."""
    force = np.stack([shares.push.real, shares.push.imag, shares.normal], axis=-1)
    return np.asarray(-(lever @ force[..., None])[..., 0])


def _smooth(x: Array) -> Any:
    """From 0 to 1 over [0, 1] without a jump in rate or acceleration."""
    x = np.minimum(np.maximum(x, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))
