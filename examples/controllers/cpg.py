"""A controller: six coupled oscillators swing the legs in joint space, without inverse kinematics.

Each leg has a phase; coupling pulls the phases into a tripod. In the first half of its cycle a leg
is in the air: its coxa swings forward and its femur lifts the foot. In the second half the coxa
pushes backward. Parameters are keys of the scenario's [control], or --set control.NAME=VALUE.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller import BodyCommand, Diagnostics, JointCommand, Measurement
from hexapod_cosim.models import Robot
from hexapod_cosim.models.kinematics import foot_positions

TRIPOD = np.pi * np.array([0, 1, 0, 1, 0, 1])  # rad    phases of LF LM LR RF RM RR
LEFT = np.array([1, 1, 1, -1, -1, -1])  # a positive coxa angle moves a left foot backward


class Cpg:
    """Walks with the commanded vx and yaw rate."""

    def __init__(
        self,
        robot: Robot,
        period: float,
        *,
        frequency: float = 1.0,  # Hz    steps of a leg per second
        lift: float = 0.3,  # rad    of the femur in the air
        coupling: float = 4.0,  # 1/s    of the oscillators
    ) -> None:
        self.period, self.frequency, self.lift, self.coupling = period, frequency, lift, coupling
        self.robot, self.stance = robot, np.array(robot.stance)  # rad    (6, 3)
        self.diagnostics = Diagnostics()  # the plan, with which metrics compare the feet
        feet = foot_positions(robot, self.stance)  # m    (6, 3) torso frame
        hips = np.array([leg.hip_position for leg in robot.legs])
        self.beside = feet[:, 1]  # m    of each foot, to the left
        self.reach = np.linalg.norm((feet - hips)[:, :2], axis=1)  # m    from coxa to foot
        self.phase = TRIPOD.copy()
        self.angle = self.stance

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for the next macro-step."""
        gap = np.subtract.outer(self.phase - TRIPOD, self.phase - TRIPOD)
        rate = 2.0 * np.pi * self.frequency - self.coupling * np.sin(gap).mean(axis=1)  # rad/s
        self.phase = self.phase + self.period * rate
        speed = command.vx - command.yaw_rate * self.beside  # m/s    of the ground under each foot
        stride = min(t, 1.0) * speed / (4.0 * self.frequency * self.reach)  # rad    to each side
        angle = self.stance.copy()
        angle[:, 0] += LEFT * stride * np.cos(self.phase)
        angle[:, 1] += min(t, 1.0) * self.lift * np.maximum(np.sin(self.phase), 0.0)
        self.diagnostics.planned[:] = foot_positions(self.robot, angle)
        self.diagnostics.swinging[:] = np.sin(self.phase) > 0.0
        rates = (angle - self.angle) / self.period
        self.angle = angle
        return JointCommand(angle_ref=angle, speed_ref=rates)
