"""Which foot carries what: the planned weight and acceleration, shared by the standing feet.

C: support.c. The ground must give the robot the force and the moment that its planned motion
demands (inverse_dynamics.py). The shares of the feet are those with the least sum of f_n^2/a that
do it (C19, C20), so that no foot squeezes another. The activation a in [0, 1] of a leg is 1 while
it stands and 0 in the air; in between it hands its load over, half before and half after the moment
at which the paths say that one foot lifts off and the next has landed (C18). As the ground gives
way under a load, a foot is lowered by what it will press in more than in the stance (C21).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hexapod_cosim.controller.gains import SupportGains
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, across, clamp, rows_of, square
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.inverse_dynamics import Demand
from hexapod_cosim.models import Robot

RIDGE_SHARE = 1e-9  # 1    of the mean square arm: feet on one line share no moment about it
LEAST_ARM = 1e-12  # m2    keeps the equations of no standing foot at all solvable
LEAST_SPREAD = 1e-4  # m2    of the feet about their centre: less takes no moment about the vertical
LEAST_LOAD = 1e-6  # N    less is no load to share by
ONES = np.ones(LEGS)


class Shares(NamedTuple):
    """Planned forces of the ground on the feet, walking frame, (6,) each."""

    activation: Array  # 1    in [0, 1]
    normal: Array  # N    vertical, never negative
    push: Plane  # N    horizontal, x + i y

    def forces(self) -> Array:
        """(6, 3) the forces [N]."""
        return rows_of(self.push.real, self.push.imag, self.normal)


def indentation(load: Any, stiffness: float) -> Any:
    """Depth [m] to which the ground gives way under loads [N], (f_n/K)^(2/3) (C21)."""
    return np.cbrt(load / stiffness) ** 2


def _smooth(x: Array) -> Array:
    """From 0 to 1 over [0, 1] without a jump in rate or acceleration."""
    x = clamp(x, 0.0, 1.0)
    return np.asarray(x * x * x * (10.0 + x * (6.0 * x - 15.0)))


def _solve(system: Array, needed: tuple[float, float, float]) -> Array:
    """x of S x = b, S (3, 3) symmetric and positive semidefinite, by S = L D L^T: (3,).

    A ridge on the diagonal keeps S definite.
    """
    (s00, s01, s02), (_, s11, s12), (_, _, s22) = system.tolist()
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
    return np.array([b0 / d0 - l10 * x1 - l20 * x2, x1, x2])


class Support:
    """Hand-over and shares of one gait on one robot."""

    def __init__(self, robot: Robot, gait: Gait, gains: SupportGains, *, rest: Demand) -> None:
        """rest: what the robot demands in its stance."""
        self.duty, self.stiffness, self.rest = gait.duty, robot.contact.stiffness, rest
        # the hand-overs of a leg never overlap, whatever the gait
        self.handover = min(gains.handover_time / gait.period, gait.duty, 1.0 - gait.duty)  # cycles
        self.rest_depth = indentation(rest.weight / LEGS, self.stiffness)  # m

    def activation(self, phase: Array, stayed: Mask, stays: Mask, *, walking: bool) -> Array:
        """The activations of legs at gait phases (C18), (6,) in [0, 1].

        stayed, stays: (6,) legs that had nowhere to step at their last lift-off, or will have
        nowhere to step at their next one.
        """
        if not walking:
            return np.ones_like(phase)
        half = 0.5 * self.handover
        since = (phase + half) % 1.0  # cycles since the activation began to rise
        rising = _smooth(since / self.handover)
        falling = _smooth((self.duty + 2.0 * half - since) / self.handover)
        # a leg that stayed where it was has neither given up its load nor takes it up again
        handing = np.minimum(np.where(stayed, 1.0, rising), np.where(stays, 1.0, falling))
        return np.where(stayed & (phase >= self.duty), 1.0, handing)

    def share_normal(self, feet: Plane, activation: Array, weight: float, moment: complex) -> Array:
        """The vertical shares (C19), (6,) [N].

        Args:
            feet: (6,) x + i y, walking frame [m].
            activation: (6,) in [0, 1].
            weight, moment: what the sums of f_n and of p f_n shall be [N, N m].
        """
        one = np.array([ONES, feet.real, feet.imag])
        weighted = one * activation
        found = _solve(weighted @ one.T, (weight, moment.real, moment.imag))
        return np.maximum(found @ weighted, 0.0)

    def lowering(self, feet: Plane, activation: Array) -> Array:
        """How much lower than planned the feet must be for the torso to keep its height (C21).

        The torso keeps its height over ground that gives way. Arguments are those of
        share_normal(); returns (6,) [m].
        """
        normal = self.share_normal(feet, activation, self.rest.weight, self.rest.moment)
        return np.asarray(indentation(normal, self.stiffness) - self.rest_depth)

    def shares(self, feet: Plane, activation: Array, demand: Demand) -> Shares:
        """The shares (C19, C20) of feet (6,) x + i y, walking frame [m]."""
        normal = self.share_normal(feet, activation, demand.weight, demand.moment)
        part = normal / max(normal.sum(), LEAST_LOAD)
        centre = part @ feet
        arm = feet - centre
        spread = part @ square(arm)
        turn = 0.0
        if spread >= LEAST_SPREAD:
            turn = (demand.twist - across(centre, demand.push)) / spread
        return Shares(activation, normal, part * (demand.push + 1j * turn * arm))
