"""Designs the laws of the paper's control with the same loops and margins as the compliant one's.

The laws shift a foot [m] by the force on it [N], and inverse kinematics turns shifts into angles.
The plant is therefore the standing robot from shifts to forces. All feet share both laws, so that
its eigenloci times a law are the loops. Nothing is subtracted from the forces: a common push or
twist of the feet has loci too.
"""

from __future__ import annotations

from dataclasses import asdict, replace

import control
import numpy as np

from hexapod_cosim.controller.design.closed import parallel, spectral_radius
from hexapod_cosim.controller.design.laws import Laws, delay
from hexapod_cosim.controller.design.loci import Plants, Response, response, tracked
from hexapod_cosim.controller.design.standing import ANGLES, FORCES, JOINTS, StandingPlant, axes_of
from hexapod_cosim.controller.gains import PaperSlipGains, Requirements
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot

GIVE_IN, ATTEMPTS = 0.8, 24  # 1    factor on gain and frequency while a whole loop is unstable


def shifted(robot: Robot, plant: StandingPlant) -> control.StateSpace:
    """Returns the plant as a system from shifts (3 n) [m] to forces of the standing feet [N].

    The foot is the slowest index of both.
    """
    chosen, bends = np.repeat(plant.standing, 3), np.zeros((ANGLES, FORCES))
    for leg, jacobian in enumerate(LegSolver(robot).jacobian(plant.angle)):
        rows = slice(JOINTS * leg, JOINTS * (leg + 1))
        bends[rows, rows] = np.linalg.inv(jacobian)
    system = plant.system
    inputs = system.B[:, :ANGLES] @ bends[:, chosen]
    return control.ss(system.A, inputs, system.C[:FORCES][chosen], 0, system.dt)


def paper_loci(robot: Robot, plant: StandingPlant, omega: Array) -> tuple[Response, Response]:
    """Returns the tangential (2 n, frequencies) and vertical (n, frequencies) eigenloci [N/m].

    They are those of a plant on n standing feet, for negative feedback. omega: (frequencies,)
    [rad/s].
    """
    answer = response(shifted(robot, plant), omega)
    flat, up = axes_of(int(plant.standing.sum()))
    along, above = answer[:, flat][:, :, flat], answer[:, up][:, :, up]
    return tracked(np.linalg.eigvals(-along)), tracked(np.linalg.eigvals(-above))


def paper_loop(robot: Robot, plant: StandingPlant, laws: Laws) -> control.StateSpace:
    """Returns the loop from disturbing shifts (3 n) to forces of the standing feet (3 n)."""
    count = int(plant.standing.sum())
    flat, up = axes_of(count)
    order = np.eye(3 * count)[[*flat, *up]]
    pid, spring = laws.systems
    both = control.append(parallel(pid, 2 * count), parallel(spring, count))
    law = control.ss(
        both.A, both.B @ order, order.T @ both.C, order.T @ both.D @ order, laws.period
    )
    late = parallel(delay(laws.delays, period=laws.period), 3 * count)
    return control.feedback(shifted(robot, plant), law * late, sign=1)


def stable(robot: Robot, plants: Plants, laws: Laws) -> tuple[Laws, float]:
    """Reduces gain and frequency of the laws until every whole loop is stable.

    Returns the laws and the largest spectral radius of the loops, at least 1 when no attempt
    succeeded.
    """
    radius = 1.0
    for _ in range(ATTEMPTS):
        radius = max(
            spectral_radius(paper_loop(robot, plant, laws), feet=int(plant.standing.sum()))
            for plant in plants.values()
        )
        if radius < 1.0:
            break
        slip, spring = laws.slip, laws.suspension
        laws = replace(
            laws,
            slip=replace(slip, kp=GIVE_IN * slip.kp, ki=GIVE_IN * slip.ki, kd=GIVE_IN * slip.kd),
            suspension=replace(
                spring, mass=spring.mass / GIVE_IN**2, damping=spring.damping / GIVE_IN
            ),
        )
    return laws, radius


def paper_slip(laws: Laws, needs: Requirements) -> PaperSlipGains:
    """Returns the PID of a design as gains of the paper's control.

    The largest shift is that of the suspension.
    """
    return PaperSlipGains(**asdict(laws.slip) | {"limit": needs.deflection_limit})
