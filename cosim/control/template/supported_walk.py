"""A controller: feet on paths of their own, joint angles by inverse kinematics, torques by statics.

A tripod of three legs stands while the other one swings, and both stand in between. A standing foot
moves against the body, so that it keeps its place on the ground; a swinging foot goes to where its
next stance begins. Torques that are fed forward carry the robot's weight, so that the legs do not
sag and squeeze each other. Parameters are keys of the scenario's [control], or --set
control.NAME=VALUE.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, Diagnostics, JointCommand, LegSolver, Measurement
from hexapod_cosim.models import Robot

DUTY = 0.6  # 1    part of its cycle for which a leg stands
OVERLAP = DUTY - 0.5  # 1    part of the cycle in which all legs stand and the load changes
PHASE = np.array([0.0, 0.5, 0.0, 0.5, 0.0, 0.5]) + OVERLAP / 2  # 1    of LF LM LR RF RM RR at t = 0


def smooth(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns a step from 0 at x = 0 to 1 at x = 1, without speed and acceleration at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))


class SupportedWalk:
    """Walks with the commanded velocity and yaw rate."""

    def __init__(
        self,
        robot: Robot,
        period: float,
        *,
        cycle: float = 1.0,  # s    of a leg: its stance and its swing
        lift: float = 0.03,  # m    of a foot in the air
        support: float = 1.0,  # 1    part of the weight that is fed forward
    ) -> None:
        self.period, self.cycle, self.lift = period, cycle, lift
        self.load = support * robot.weight  # N
        self.legs = LegSolver(robot)
        self.home = self.legs.forward(robot.stance)  # m    (6, 3) feet of the stance, torso frame
        self.angle = robot.stance  # rad    (6, 3)
        self.diagnostics = Diagnostics()  # the plan, with which metrics compare the feet

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for the next macro-step."""
        phase = (t / self.cycle + PHASE) % 1.0
        feet = self.feet(phase, command, ramp=min(t / self.cycle, 1.0))
        self.diagnostics.planned[:] = feet
        self.diagnostics.swinging[:] = phase > DUTY
        angle = self.legs.inverse(feet)
        speed = (angle - self.angle) / self.period
        self.angle = angle
        # the ground's force f lifts a foot; the joints balance it with the torques -J^T f
        lever = self.legs.jacobian(angle)[:, 2]  # m    (6, 3) rise of a foot per joint angle
        torque = -lever * self.loads(phase, feet)[:, np.newaxis]
        return JointCommand(angle_ref=angle, speed_ref=speed, torque_ref=torque)

    def feet(
        self, phase: NDArray[np.float64], command: BodyCommand, ramp: float
    ) -> NDArray[np.float64]:
        """Returns the feet (6, 3) in the torso frame [m] at phases (6,) of the legs."""
        swing = np.maximum(phase - DUTY, 0.0) / (1.0 - DUTY)
        # time since the body was above the foot; a swing takes the foot one cycle ahead
        since = ramp * self.cycle * (phase - DUTY / 2.0 - smooth(swing))
        turn, (x, y, z) = command.yaw_rate * since, self.home.T
        return np.stack(
            [
                np.cos(turn) * x + np.sin(turn) * y - command.vx * since,
                np.cos(turn) * y - np.sin(turn) * x - command.vy * since,
                z + self.lift * np.sin(np.pi * swing) ** 2,
            ],
            axis=1,
        )

    def loads(self, phase: NDArray[np.float64], feet: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns vertical forces (6,) on the feet [N] that balance the weight at the origin."""
        active = smooth(np.minimum(phase, DUTY - phase) / OVERLAP)  # 0 in the air
        rows = np.stack([np.ones(6), feet[:, 0], feet[:, 1]])  # sum and moments of forces
        factors = np.linalg.solve(active * rows @ rows.T, [self.load, 0.0, 0.0])
        return np.asarray(active * (factors @ rows))
