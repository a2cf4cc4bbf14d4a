"""Computes by how far the torso sways against the swinging legs. C: sway.c.

A swinging leg takes its mass forwards and stops it again. Under a torso of constant velocity the
feet that stand must push for that, forwards and backwards in every swing. The torso instead moves
so that the centre of mass of the whole robot keeps its velocity (C57). Then these feet need no push
for the swinging legs. The sway is a few millimetres.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.comply.posture import Posture
from hexapod_cosim.controller.plane import LEGS, along
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
    """Returns the way of the torso over that of a foot in the direction `way` of length REACH."""
    moved = _moment_of(dynamics, legs, way) - _moment_of(dynamics, legs, -way)
    carried = along(way, moved) / (2.0 * REACH * REACH)  # kg    moves with all feet
    total = dynamics.torso_mass + float(dynamics.mass.sum())
    return float(carried / (LEGS * (total - carried)))


class Sway:
    """Computes the sway of one robot. active: the part is on; otherwise there is no sway."""

    def __init__(self, dynamics: InverseDynamics, legs: LegSolver, *, active: bool) -> None:
        self.home = complex(dynamics.stance[:, 0].sum(), dynamics.stance[:, 1].sum())  # m
        self.forward, self.aside = 0.0, 0.0  # 1    way of the torso over that of a foot, x and y
        if active:
            self.forward = _share_of(dynamics, legs, complex(REACH, 0.0))
            self.aside = _share_of(dynamics, legs, complex(0.0, REACH))

    def of(self, feet: PlannedFeet) -> tuple[complex, complex]:
        """Returns the way of the torso in the walking frame [m], x + i y, and its rate [m/s]."""
        away, speed = complex(feet.plane.sum()) - self.home, complex(feet.velocity.sum())
        return (
            complex(-self.forward * away.real, -self.aside * away.imag),
            complex(-self.forward * speed.real, -self.aside * speed.imag),
        )
