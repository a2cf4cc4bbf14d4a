"""What the design starts from: the standing robot as a linear system, and what the controller does
to it.

The controller speaks to a leg in forces: G (3,) [N] is what its servos are told to push less. The
joints' angles are bent by J^T G / kp, which shifts the foot's target by C G, C = J J^T / kp. A foot
that sticks then answers with the force -G.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller.comply.compliance import LARGEST_LOAD
from hexapod_cosim.controller.comply.slip_pid import squeeze
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

    system: sampled at the controller's period, inputs held over it. Inputs: 18 angle_ref, 18
    speed_ref, 18 torque_ref. Outputs: 18 foot forces (ground on foot, world axes), then whatever
    else. Legs slowest.
    """

    system: control.StateSpace
    angle: Array  # rad    (6, 3)
    force: Array  # N    (6, 3) ground on foot
    torque: Array  # N m    (6, 3) that the servos were told, to carry it
    standing: Mask  # (6,)

    def load(self, robot: Robot) -> Array:
        """1    (n,) normal forces of the standing feet in thirds of the weight"""
        return np.asarray(self.force[self.standing, 2] / weight_share(robot))


def weight_share(robot: Robot) -> float:
    """N    one leg's share of the weight while three legs stand"""
    return robot.weight / TRIPOD_LEGS


def relieved(robot: Robot, plant: StandingPlant) -> control.StateSpace:
    """Forces of the standing feet (3 n) after forces G (3 n) that their servos are relieved of
    [N], both legs slowest.
    """
    chosen, told = np.repeat(plant.standing, 3), np.zeros((ANGLES, FORCES))
    for leg, jacobian in enumerate(LegSolver(robot).jacobian(plant.angle)):
        rows = slice(JOINTS * leg, JOINTS * (leg + 1))
        told[rows, rows] = jacobian.T / robot.servo.kp
    system = plant.system
    return control.ss(
        system.A, system.B[:, :ANGLES] @ told[:, chosen], system.C[:FORCES][chosen], 0, system.dt
    )


def squeeze_matrix(robot: Robot, plant: StandingPlant) -> Array:
    """(2 n, 2 n) e = S f: the horizontal forces of the standing feet less their common push and
    twist, by the law that runs.
    """
    normal, feet = (
        plant.force[plant.standing, 2],
        LegSolver(robot).forward(plant.angle)[plant.standing],
    )
    places = feet[:, 0] + 1j * feet[:, 1]
    columns = [
        squeeze(unit[::2] + 1j * unit[1::2], normal, places) for unit in np.eye(2 * len(normal))
    ]
    return np.column_stack(
        [np.column_stack([column.real, column.imag]).reshape(-1) for column in columns]
    )


def answers(robot: Robot, plant: StandingPlant) -> tuple[Array, Array]:
    """What a standing foot's G is per answer of its laws: (n,) loads [1] of the PID's force,
    (n,) 1/C_zz [N/m] of the suspension's z.
    """
    jacobian = LegSolver(robot).jacobian(plant.angle)[plant.standing]
    vertical = (jacobian[:, 2] ** 2).sum(axis=1) / robot.servo.kp
    return np.minimum(plant.load(robot), LARGEST_LOAD), 1.0 / vertical


def axes_of(count: int) -> tuple[Places, Places]:
    """Places of the horizontal (2 n) and the vertical (n) entries among the 3 n of n feet."""
    places = np.arange(3 * count).reshape(count, 3)
    return places[:, :2].reshape(-1), places[:, 2]
