"""Shares the force that the planned motion needs among the standing feet. C: support.h.

The ground must exert the force and the moment that the planned motion needs (inverse_dynamics.py).
Of all shares that do so, those with the least sum of f_n^2/a are taken (C19, C20), and no foot
squeezes another. The activation a in [0, 1] of a leg is 1 while it stands and 0 in the air. Its
load changes half before and half after the planned lift-off or touch-down (C18). The ground yields
under a load, so each foot is lowered by its indentation less that in the stance (C21).
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.comply.load_plan import LEAST_LOAD, Shares, indentation, solve
from hexapod_cosim.controller.gains import SupportGains
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, across, clamp, square
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.inverse_dynamics import Demand
from hexapod_cosim.models import Robot

LEAST_SPREAD = 1e-4  # m2    mean square distance of the feet from their centre: below it no twist
ONES = np.ones(LEGS)


def _smooth(x: Array) -> Array:
    """Returns S of C18: rises from 0 to 1 over [0, 1] without a jump in rate or acceleration."""
    x = clamp(x, 0.0, 1.0)
    return np.asarray(x * x * x * (10.0 + x * (6.0 * x - 15.0)))


class Support:
    """Computes activations and load shares for one gait of one robot."""

    def __init__(
        self, robot: Robot, gait: Gait, gains: SupportGains, *, rest: Demand, active: bool = True
    ) -> None:
        """Computes the constants of gait and ground.

        rest: the demand of the standing robot; active: the part is on; otherwise no foot is lowered
        and no servo carries the load.
        """
        self.active = active
        self.duty, self.stiffness, self.rest = gait.duty, robot.contact.stiffness, rest
        # limited, so that the two changes of a leg's load do not overlap in any gait
        self.handover = min(gains.handover_time / gait.period, gait.duty, 1.0 - gait.duty)  # cycles
        self.rest_depth = indentation(rest.weight / LEGS, self.stiffness)  # m

    def activation(self, phase: Array, stayed: Mask, stays: Mask, *, walking: bool) -> Array:
        """Returns the activations (6,) in [0, 1] of legs at gait phases (6,) (C18).

        stayed: (6,) legs that did not step at their last lift-off; stays: (6,) legs that will not
        step at their next one.
        """
        if not walking:
            return np.ones_like(phase)
        half = 0.5 * self.handover
        since = (phase + half) % 1.0  # cycles since the activation began to rise
        until = self.duty + 2.0 * half - since  # cycles until it has fallen
        rising, falling = _smooth(np.array((since, until)) / self.handover)
        # a leg that did not step has kept its load
        handing = np.minimum(np.where(stayed, 1.0, rising), np.where(stays, 1.0, falling))
        return np.where(stayed & (phase >= self.duty), 1.0, handing)

    def share_normal(self, feet: Plane, activation: Array, weight: float, moment: complex) -> Array:
        """Returns the vertical shares (6,) [N] (C19).

        Args:
            feet: (6,) x + i y, walking frame [m].
            activation: (6,) in [0, 1].
            weight: required sum of f_n [N].
            moment: required sum of p f_n [N m].
        """
        one = np.array([ONES, feet.real, feet.imag])
        weighted = one * activation
        (s00, s01, s02), (_, s11, s12), (_, _, s22) = (weighted @ one.T).tolist()
        found = solve((s00, s01, s02, s11, s12, s22), (weight, moment.real, moment.imag))
        return np.maximum(np.array(found) @ weighted, 0.0)

    def lowering(self, feet: Plane, activation: Array) -> Array:
        """Returns by how much the feet (6,) are lowered for the torso to keep its height [m] (C21).

        Arguments are those of share_normal().
        """
        if not self.active:
            return np.zeros(LEGS)
        normal = self.share_normal(feet, activation, self.rest.weight, self.rest.moment)
        return np.asarray(indentation(normal, self.stiffness) - self.rest_depth)

    def shares(self, feet: Plane, activation: Array, demand: Demand) -> Shares:
        """Returns the shares (C19, C20) of feet (6,) x + i y, walking frame [m]."""
        normal = self.share_normal(feet, activation, demand.weight, demand.moment)
        part = normal / max(normal.sum(), LEAST_LOAD)
        centre = part @ feet
        arm = feet - centre
        spread = part @ square(arm)
        turn = 0.0
        if spread >= LEAST_SPREAD:
            turn = (demand.twist - across(centre, demand.push)) / spread
        push = part * (demand.push + 1j * turn * arm)
        return Shares(activation, normal, push, np.zeros(LEGS, dtype=np.complex128))
