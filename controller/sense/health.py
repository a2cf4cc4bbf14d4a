"""Finds servos that do not follow their commands, and when they do again (C57). C: health.h.

The model of a servo says which torque it gives at its measured angle. The foot's measured force and
the levers of the leg say which torque its joint needs. What is left, the unexplained torque, is
small while the servo works: its own weight, and errors of the model. Damping and the inertia of the
rotor, which the model does not know exactly, explain a torque between bounds. A limp servo gives no
torque, however far its joint is from the command; a locked one resists the command without any
load. Either way the model gives a torque near the servo's largest that nothing explains.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, clamp
from hexapod_cosim.controller.signals import JointCommand
from hexapod_cosim.controller.walk.gait_clock import NO_LEG
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.models import Robot

STRANGE_SHARE = 0.5  # 1    of the largest torque, that nothing explains
STRANGE_TIME = 0.035  # s    in one direction: the servo does not work
DAMPING_TIME = 0.02  # s    largest damping over stiffness, besides the drag of the model
STILL_SPEED = 0.05  # rad/s    of a joint that does not move
SOUND_SHARE = 0.35  # 1    of the largest torque: the servo seems to work
PROOF_TIME = 1.2  # s    for which a servo must seem to work: longer than a period of the trial


class Health(Stateful):
    """State of the servos of one robot.

    Attributes, (6, 3) each:
        strange: time for which its torque has been unexplained, with its sign [s].
        goal: angle that the firmware has led its servo to [rad].
        angle: measured at the last step [rad].
        speed: of the joint in the period before it [rad/s].
        still: time for which a joint has not moved [s].
        locked: faulty servos whose joints did not move when this was found.
        proof: time for which a servo has seemed to work [s].
        faulty: servos that do not work.
    """

    STATE = ("strange", "goal", "angle", "speed", "still", "locked", "proof", "faulty")

    def __init__(
        self, robot: Robot, gains: Gains | None, *, legs: LegSolver, period: float
    ) -> None:
        """Starts with sound servos. Kinematic control, without gains, does not watch them."""
        self.stiffness, self.drag = robot.servo.kp, robot.servo.drag
        self.rotor = robot.servo.rotor_inertia
        self.legs, self.period = legs, period
        self.way = robot.servo.goal_speed_max * period or math.inf  # rad    of a goal, at most
        allowed = math.inf if gains is None else gains.limits.torque
        self.most = min(allowed, robot.servo.torque_limit)  # N m
        self.reset()

    def reset(self) -> None:
        """Starts anew with sound servos."""
        self.strange, self.proof, self.still, self.speed = np.zeros((4, LEGS, 3))
        self.locked: Mask = np.zeros((LEGS, 3), dtype=np.bool_)
        self.angle: Array | None = None
        self.goal: Array | None = None
        self.faulty: Mask = np.zeros((LEGS, 3), dtype=np.bool_)

    @property
    def lost(self) -> Mask:
        """Returns the legs (6,) of which some servo does not work."""
        return np.asarray(self.faulty.any(axis=1))

    @property
    def bearing(self) -> Mask:
        """Returns the legs (6,) that can bear a load: neither femur nor tibia is limp."""
        limp = self.faulty & ~self.locked
        return np.asarray(~limp[:, 1:].any(axis=1))

    def _unexplained(
        self, angle: Array, force: Array, command: JointCommand, lifted: Mask
    ) -> Array:
        """Returns the torques (6, 3) of the servos' model that nothing explains [N m]."""
        before, fastest = angle if self.angle is None else self.angle, self.legs.speed_max
        speed = (angle - before) / self.period
        load = speed / fastest
        low = -self.most * clamp(1.0 + load, 0.0, 1.0)
        high = self.most * clamp(1.0 - load, 0.0, 1.0)
        goal = command.angle_ref + self.period * clamp(command.speed_ref, -fastest, fastest)
        if self.goal is not None and self.way < math.inf:
            goal = clamp(goal, self.goal - self.way, self.goal + self.way)
        self.goal = goal
        torque = self.stiffness * (goal - angle) + command.torque_ref - self.drag * speed
        damping = DAMPING_TIME * self.stiffness
        slowed, followed = torque - damping * speed, torque + damping * (command.speed_ref - speed)
        weakest = np.minimum(torque, np.minimum(slowed, followed))
        strongest = np.maximum(torque, np.maximum(slowed, followed))
        # a larger load is no fault of the servo
        needed = clamp(self.legs.load_torques(angle, force), -self.most, self.most)
        free = np.where(lifted[:, None], 0.0, needed)
        spin = self.rotor / self.period * (speed - self.speed)
        self.speed = speed
        least = clamp(weakest, low, high) - np.maximum(needed, free) - np.maximum(spin, 0.0)
        most = clamp(strongest, low, high) - np.minimum(needed, free) - np.minimum(spin, 0.0)
        return np.asarray(np.maximum(least, 0.0) + np.minimum(most, 0.0))

    def step(
        self, angle: Array, force: Array, command: JointCommand, lifted: Mask = NO_LEG
    ) -> None:
        """Judges the servos by a period under a command.

        Args:
            angle: (6, 3) measured at its end [rad].
            force: (6, 3) of the ground on the feet, torso axes [N].
            command: to the servos.
            lifted: (6,) feet that their legs lift. They bear none to all of the force: a stuck
                sensor, or a stone in the way of the leg.
        """
        excess = self._unexplained(angle, force, command, lifted) / self.most
        size, before = np.abs(excess), angle if self.angle is None else self.angle
        rests = np.abs(angle - before) < STILL_SPEED * self.period
        self.still = np.where(rests, self.still + self.period, 0.0)
        self.angle = angle.copy()
        sign = np.where(size > STRANGE_SHARE, np.sign(excess), 0.0)
        same = np.where(sign * self.strange > 0.0, self.strange, 0.0)
        self.strange = same + sign * self.period
        self.proof = np.where(size < SOUND_SHARE, self.proof + self.period, 0.0)
        failed = np.abs(self.strange) > STRANGE_TIME
        self.locked = np.where(self.faulty, self.locked, self.still > STRANGE_TIME)
        self.faulty = (self.faulty & (self.proof < PROOF_TIME)) | failed
