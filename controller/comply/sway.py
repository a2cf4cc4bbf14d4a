"""Computes by how far the torso sways against the swinging legs. C: sway.h.

A swinging leg takes its mass forwards and stops it again. Under a torso of constant velocity the
feet that stand must push for that, forwards and backwards in every swing. The torso instead moves
so that the centre of mass of the whole robot keeps its velocity (C54). Then these feet need no push
for the swinging legs. The sway is a few millimetres. It is guessed by the shares of the mass that
move with the feet, the legs are placed for the guess, and their masses tell what is left.

The torso sways only as far as the stance is narrowed, under a payload (C53): on uneven ground a
robot without a payload loses more of its path by the sway than it gains.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.plane import LEGS, along
from hexapod_cosim.controller.walk.foot_paths import PlannedFeet
from hexapod_cosim.controller.walk.inverse_dynamics import InverseDynamics, Masses
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.controller.walk.posture import Posture

REACH = 1e-3  # m    by which all feet are moved to find the mass that moves with them


def _moment_of(dynamics: InverseDynamics, legs: LegSolver, step: complex) -> complex:
    """Returns the sum of m p of all links with all feet moved from the stance by a step [kg m]."""
    x, y, z = dynamics.stance.T
    level = Posture.of(np.zeros(3), np.zeros(3))
    masses = dynamics.place(legs.pose(x + 1j * y + step, z), 0j, 0.0, level)
    return complex((dynamics.mass * masses.place).sum())


def _share_of(dynamics: InverseDynamics, legs: LegSolver, way: complex) -> float:
    """Returns the share of the mass that moves with all feet, in a direction of length REACH."""
    moved = _moment_of(dynamics, legs, way) - _moment_of(dynamics, legs, -way)
    carried = along(way, moved) / (2.0 * REACH * REACH)  # kg
    return float(carried / dynamics.total_mass)


class Sway:
    """Computes the sway of one robot. active: the part is on; otherwise there is no sway."""

    def __init__(self, dynamics: InverseDynamics, legs: LegSolver, *, active: bool) -> None:
        self.dynamics, self.active = dynamics, active
        self.home = complex(dynamics.stance[:, 0].sum(), dynamics.stance[:, 1].sum())  # m
        self.forward, self.aside = 0.0, 0.0  # 1    share of the mass that moves with all feet
        self.rest = 0j  # kg m    sum of m p of all links in the stance
        if active:
            self.forward = _share_of(dynamics, legs, complex(REACH, 0.0))
            self.aside = _share_of(dynamics, legs, complex(0.0, REACH))
            self.rest = _moment_of(dynamics, legs, 0j)

    def acts(self, narrowing: float) -> bool:
        """Returns whether the torso sways. narrowing: part of the way to the narrow stance [1]."""
        return self.active and narrowing > 0.0

    def _yield_to(self, moment: complex, ratio: float) -> complex:
        """Returns the way of the torso that gives the robot another sum of m p [kg m].

        ratio: measured over modelled weight [1].
        """
        mass = self.dynamics.total_mass
        x = moment.real / (mass * (ratio - self.forward))
        return complex(x, moment.imag / (mass * (ratio - self.aside)))

    def guess(self, feet: PlannedFeet, weight_ratio: float) -> complex:
        """Returns nearly the whole way of the torso, by the shares [m] x + i y, walking frame."""
        away, mass = complex(feet.plane.sum()) - self.home, self.dynamics.total_mass / LEGS
        moment = complex(self.forward * mass * away.real, self.aside * mass * away.imag)
        return -self._yield_to(moment, weight_ratio)

    def of(self, guess: complex, masses: Masses, weight_ratio: float) -> complex:
        """Returns the way of the torso in the walking frame [m], x + i y (C54).

        The torso sways by the part of it by which the stance is narrowed.

        masses: of a torso that has moved by the guess; weight_ratio: measured over modelled [1].
        """
        moved = complex((self.dynamics.mass * masses.place).sum()) - self.rest
        moved += weight_ratio * self.dynamics.total_mass * guess
        return guess - self._yield_to(moved, weight_ratio)
