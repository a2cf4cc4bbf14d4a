"""Builds the closed loop of a standing plant as one discrete system, with both laws and delays."""

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

RISE = 0.05  # s    duration of the ramp of a disturbance
FREE_COORDINATES = 3  # x, y and yaw of the robot, which nothing controls


def parallel(system: control.StateSpace, count: int) -> control.StateSpace:
    """Returns `count` copies of a system of one input and one output in parallel."""
    return control.ss(
        *(np.kron(np.eye(count), matrix) for matrix in (system.A, system.B, system.C, system.D)),
        system.dt,
    )


def compliant_law(robot: Robot, plant: StandingPlant, laws: Laws) -> control.StateSpace:
    """Returns the laws as a system from foot forces (3 n) to the forces (3 n) by which legs yield.

    Both are those of the standing feet.
    """
    loads, vertical = answers(robot, plant)
    count, period = len(loads), laws.period
    flat, up = axes_of(count)
    order = np.eye(3 * count)[[*flat, *up]]
    inputs = block_diag(squeeze_matrix(robot, plant), np.eye(count)) @ order
    outputs = order.T * np.concatenate([np.repeat(loads, 2), vertical])
    pid, spring = laws.systems
    both = control.append(parallel(pid, 2 * count), parallel(spring, count))
    late = parallel(delay(laws.delays, period=period), 3 * count)
    through = outputs @ both.D @ inputs
    return control.ss(both.A, both.B @ inputs, outputs @ both.C, through, period) * late


def closed_loop(robot: Robot, plant: StandingPlant, laws: Laws) -> control.StateSpace:
    """Returns the loop from disturbances (3 n) to forces of the standing feet (3 n), both closed.

    A disturbance is added to the forces by which the legs yield.
    """
    return control.feedback(relieved(robot, plant), compliant_law(robot, plant, laws), sign=1)


def splay(robot: Robot, plant: StandingPlant) -> Array:
    """Returns the forces (3 n) of unit length by which the standing legs push each other outwards.

    They are horizontal and contain no common push or twist.
    """
    feet = LegSolver(robot).forward(plant.angle)[plant.standing]
    flat, _ = axes_of(len(feet))
    forces = np.zeros(feet.size)
    forces[flat] = squeeze_matrix(robot, plant) @ (
        feet[:, :2] / np.linalg.norm(feet[:, :2], axis=1)[:, None]
    ).reshape(-1)
    return np.asarray(forces / np.linalg.norm(forces))


def rising(time: Array) -> Array:
    """Returns a ramp from 0 to 1 within RISE.

    A jump would give the servos an impulse of commanded speed.
    """
    return np.asarray(np.clip((time + time[1]) / RISE, 0.0, 1.0))


def disturbed(
    system: control.StateSpace, disturbance: Array, *, duration: float
) -> tuple[Array, Array]:
    """Returns times (steps,) [s] and outputs (outputs, steps) of a discrete system's response.

    disturbance: final values (inputs,) of the ramps at the inputs.
    """
    time = np.arange(round(duration / system.dt)) * system.dt
    return time, np.asarray(
        control.forced_response(
            system, time, np.outer(disturbance, rising(time)), squeeze=False
        ).outputs
    )


def spectral_radius(system: control.StateSpace, *, feet: int) -> float:
    """Returns the largest magnitude of a closed loop's eigenvalues that are not 1 by construction.

    The position of the robot and that of each foot on the ground are not controlled: their
    eigenvalues are exactly 1.
    """
    values = np.linalg.eigvals(system.A)
    by_distance = np.abs(values)[np.argsort(np.abs(values - 1.0))]
    controlled: Array = by_distance[FREE_COORDINATES + 2 * feet :]
    return float(controlled.max())
