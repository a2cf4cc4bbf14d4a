"""Defines the plant that the gains are designed for: the standing robot as a linear system."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from hexapod_cosim.controller.gains import TRIPOD_LEGS
from hexapod_cosim.controller.plane import LEGS, Array, Mask
from hexapod_cosim.models import Robot

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
