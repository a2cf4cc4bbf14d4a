"""Defines the plant that the gains are designed for: the standing robot as a linear system."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller.gains import TRIPOD_LEGS
from hexapod_cosim.controller.plane import LEGS, Array, Mask
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot

Places = NDArray[np.int_]

JOINTS = 3
ANGLES = FORCES = 3 * LEGS


@dataclass(frozen=True, kw_only=True)
class StandingPlant:
    """The plant linearised about a pose in which some legs stand.

    system: sampled at the controller's period, with inputs held over it. Inputs: 18 angle_ref, 18
    speed_ref, 18 torque_ref. Outputs: 18 foot forces (ground on foot, world axes), then others.
    The leg is the slowest index of each group.
    """

    system: control.StateSpace
    angle: Array  # rad    (6, 3)
    force: Array  # N    (6, 3) ground on foot
    torque: Array  # N m    (6, 3) torque_ref of the servos
    standing: Mask  # (6,)

    def load(self, robot: Robot) -> Array:
        """Returns the normal forces of the standing feet (n,) in thirds of the weight [1]."""
        return np.asarray(self.force[self.standing, 2] / weight_share(robot))


def weight_share(robot: Robot) -> float:
    """Returns a third of the robot's weight [N], one leg's share while three legs stand."""
    return robot.weight / TRIPOD_LEGS


def relieved(robot: Robot, plant: StandingPlant) -> control.StateSpace:
    """Returns the plant as a system from forces G (3 n) to forces of the standing feet (3 n) [N].

    The foot is the slowest index of both.
    """
    chosen, bends = np.repeat(plant.standing, 3), np.zeros((ANGLES, FORCES))
    for leg, jacobian in enumerate(LegSolver(robot).jacobian(plant.angle)):
        rows = slice(JOINTS * leg, JOINTS * (leg + 1))
        bends[rows, rows] = jacobian.T / robot.servo.kp
    system = plant.system
    return control.ss(
        system.A, system.B[:, :ANGLES] @ bends[:, chosen], system.C[:FORCES][chosen], 0, system.dt
    )


def axes_of(count: int) -> tuple[Places, Places]:
    """Returns the indices of the horizontal (2 n) and vertical (n) entries in vectors (3 n)."""
    places = np.arange(3 * count).reshape(count, 3)
    return places[:, :2].reshape(-1), places[:, 2]
