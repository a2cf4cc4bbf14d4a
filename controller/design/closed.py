"""Builds and disturbs discrete systems of many feet, and finds how fast closed loops settle."""

from __future__ import annotations

import control
import numpy as np

from hexapod_cosim.controller.design.standing import StandingPlant
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


def splay(robot: Robot, plant: StandingPlant) -> Array:
    """Returns shifts (3 n) of unit length that spread the standing feet, without a common one."""
    feet = LegSolver(robot).forward(plant.angle)[plant.standing]
    outwards = feet[:, :2] / np.linalg.norm(feet[:, :2], axis=1)[:, None]
    shifts = np.zeros_like(feet)
    shifts[:, :2] = outwards - outwards.mean(axis=0)
    return np.asarray(shifts.reshape(-1) / np.linalg.norm(shifts))


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


def spectral_radius(system: control.StateSpace) -> float:
    """Returns the largest magnitude of a closed loop's eigenvalues that are not 1 by construction.

    The position of the robot on the ground is not controlled: its eigenvalues are exactly 1.
    """
    values = np.linalg.eigvals(system.A)
    by_distance = np.abs(values)[np.argsort(np.abs(values - 1.0))]
    return float(by_distance[FREE_COORDINATES:].max())
