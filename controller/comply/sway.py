"""Computes by how far the torso sways against the swinging legs. C: sway.c.

A swinging leg takes its mass forwards and stops it again. Under a torso of constant velocity the
feet that stand must push for that, forwards and backwards in every swing. The torso instead moves
so that the centre of mass of the whole robot keeps its velocity (C57). Then these feet need no push
for the swinging legs. The sway is a few millimetres.

The torso sways only as far as the stance is narrowed, under a payload (C53): on uneven ground a
robot without a payload loses more of its path by the sway than it gains.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.comply.posture import Posture
from hexapod_cosim.controller.plane import LEGS, along
from hexapod_cosim.controller.sense.warmth import Warmth
from hexapod_cosim.controller.walk.inverse_dynamics import InverseDynamics
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.controller.walk.trajectory import PlannedFeet

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
        self.home = complex(dynamics.stance[:, 0].sum(), dynamics.stance[:, 1].sum())  # m
        self.active = active
        self.forward, self.aside = 0.0, 0.0  # 1    share of the mass that moves with all feet
        if active:
            self.forward = _share_of(dynamics, legs, complex(REACH, 0.0))
            self.aside = _share_of(dynamics, legs, complex(0.0, REACH))

    def laden(self, warmth: Warmth) -> float:
        """Returns the weight that sways over the modelled one [1]."""
        return warmth.laden() if self.active else 1.0

    def of(self, feet: PlannedFeet, warmth: Warmth) -> tuple[complex, complex]:
        """Returns the way of the torso in the walking frame [m], x + i y, and its rate [m/s].

        The rate is that under a constant weight, which changes slowly.
        """
        away, speed = complex(feet.plane.sum()) - self.home, complex(feet.velocity.sum())
        part, laden = warmth.narrowing / LEGS, warmth.laden()
        x = part * self.forward / (laden - self.forward)
        y = part * self.aside / (laden - self.aside)
        return complex(-x * away.real, -y * away.imag), complex(-x * speed.real, -y * speed.imag)
