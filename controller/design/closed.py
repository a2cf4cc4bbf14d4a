"""The whole closed loop of a standing plant: all feet, both laws, delays, in one discrete
system.
"""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import block_diag

from hexapod_cosim.controller.design.laws import Laws, delay
from hexapod_cosim.controller.design.standing import (
    StandingPlant,
    answers,
    axes_of,
    relieved,
    squeeze_matrix,
)
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot

RISE = 0.05  # s
PLACES = 3  # x, y and yaw of the robot, which nothing holds


def parallel(system: control.StateSpace, count: int) -> control.StateSpace:
    """`count` of a system of one input and one output side by side."""
    return control.ss(
        *(np.kron(np.eye(count), matrix) for matrix in (system.A, system.B, system.C, system.D)),
        system.dt,
    )


def compliant_law(robot: Robot, plant: StandingPlant, laws: Laws) -> control.StateSpace:
    """From the standing feet's forces (3 n) to what their servos are relieved of (3 n)."""
    loads, vertical = answers(robot, plant)
    count, period = len(loads), laws.period
    flat, up = axes_of(count)
    order = np.eye(3 * count)[[*flat, *up]]
    seen, told = (
        block_diag(squeeze_matrix(robot, plant), np.eye(count)) @ order,
        order.T * np.concatenate([np.repeat(loads, 2), vertical]),
    )
    pid, spring = laws.systems
    both = control.append(parallel(pid, 2 * count), parallel(spring, count))
    late = parallel(delay(laws.delays, period=period), 3 * count)
    return control.ss(both.A, both.B @ seen, told @ both.C, told @ both.D @ seen, period) * late


def closed_loop(robot: Robot, plant: StandingPlant, laws: Laws) -> control.StateSpace:
    """Forces of the standing feet (3 n) after a disturbance (3 n) that acts as a relief does,
    both laws at work.
    """
    return control.feedback(relieved(robot, plant), compliant_law(robot, plant, laws), sign=1)


def splay(robot: Robot, plant: StandingPlant) -> Array:
    """(3 n) horizontal forces of unit length with which the standing legs splay against each other:
    outwards, less the common push and twist.
    """
    feet = LegSolver(robot).forward(plant.angle)[plant.standing]
    flat, _ = axes_of(len(feet))
    forces = np.zeros(feet.size)
    forces[flat] = squeeze_matrix(robot, plant) @ (
        feet[:, :2] / np.linalg.norm(feet[:, :2], axis=1)[:, None]
    ).reshape(-1)
    return np.asarray(forces / np.linalg.norm(forces))


def rising(time: Array) -> Array:
    """1    a disturbance that comes within RISE and stays; a jump would be a blow by the speeds
    that the servos are told
    """
    return np.asarray(np.clip((time + time[1]) / RISE, 0.0, 1.0))


def disturbed(
    system: control.StateSpace, disturbance: Array, *, duration: float
) -> tuple[Array, Array]:
    """Times (steps,) [s] and outputs (outputs, steps) of a discrete system after a rising
    disturbance (inputs,).
    """
    time = np.arange(round(duration / system.dt)) * system.dt
    return time, np.asarray(
        control.forced_response(
            system, time, np.outer(disturbance, rising(time)), squeeze=False
        ).outputs
    )


def spectral_radius(system: control.StateSpace, *, feet: int) -> float:
    """Largest size of a closed loop's eigenvalues but those of what nothing holds.

    These are exactly 1: the robot's place, and each foot's on the ground, which the integrals keep;
    squeezed or not they are at rest.
    """
    values = np.linalg.eigvals(system.A)
    moving: Array = np.abs(values)[np.argsort(np.abs(values - 1.0))][PLACES + 2 * feet :]
    return float(moving.max())
