"""Slows the body where the joints cannot follow its command (C59). C: pace.h.

In a settled walk a foot on the ground keeps its point, and a swing ends where the foot will be
under its stance position half-way through the next stance. This gives the speeds that the joints
need in a whole cycle of a command. Where they are too high, the commanded velocity is multiplied by
the largest share with which they are not. So the walk slows down before its feet land late.
"""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import Array, Mask, Plane, cis
from hexapod_cosim.controller.walk.command import BodyCommand
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.gait_clock import NO_LEG
from hexapod_cosim.controller.walk.kinematics import Feet, LegSolver
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.controller.walk.swing import Twist, blend, hop, travel
from hexapod_cosim.models.errors import check_type

# 1    joint speed that a command may need, over the largest one or over that of steps on the spot:
# servos follow so short a peak (the PhantomX's own walk has 1.056), and feet land late from 1.2 on
FASTEST = 1.06
STANCE_SAMPLES, SWING_SAMPLES = 5, 16  # moments of the cycle that are looked at
HALVINGS = 14  # of the interval in which the share lies: it is exact to 6e-5


class Pace(Stateful):
    """Finds the share of a command that the joints can follow in a gait.

    Attributes:
        asked: the last command as it was given.
        outrun: (6,) legs whose joints cannot follow it, so that the body walks slower.
    """

    STATE = ("asked", "outrun")

    def __init__(self, gait: Gait, legs: LegSolver, height: Array) -> None:
        """Samples the cycle of a gait. height: (6,) of the feet in the stance [m]."""
        self.legs, self.cycle = legs, gait.period
        stance, swing = gait.period * gait.duty, gait.period * (1.0 - gait.duty)
        tau = (np.arange(SWING_SAMPLES) + 0.5) / SWING_SAMPLES
        part, slope = blend(tau)
        lift, climb = hop(tau, top=gait.step_height, down=gait.touchdown_speed * swing)
        still, begin = np.zeros(STANCE_SAMPLES), np.linspace(-0.5, 0.5, STANCE_SAMPLES)
        # (21, 1) each
        self.time = np.append(stance * begin, 0.5 * stance + tau * swing)[:, None]  # s
        self.part = np.append(still, part)[:, None]  # 1    of the way to the next stance
        self.rate = np.append(still, slope / swing)[:, None]  # 1/s
        self.height = height + np.append(still, lift)[:, None]  # m    (21, 6)
        self.rise = np.append(still, climb / swing)[:, None]  # m/s
        self.reset()

    def reset(self) -> None:
        """Forgets the last command."""
        self.asked, self.outrun = BodyCommand(), NO_LEG

    def needed(self, command: Array, home: Plane, torso: complex) -> Array:
        """Returns the largest joint speeds (6,) of the legs over that of the servos [1] (C59).

        Args:
            command: (6,) vx vy yaw_rate height roll pitch.
            home: (6,) positions that the steps aim at, walking frame [m].
            torso: way of the torso from its nominal place, walking frame [m].
        """
        vx, vy, w = command[:3].tolist()
        twist, posture = Twist(complex(vx, vy), w), Posture.of(command[3:], np.zeros(3))
        step = travel(twist, self.cycle) + (cis(w * self.cycle) - 1.0) * home
        back = cis(-w * self.time)
        plane = back * (home + self.part * step - travel(twist, self.time))
        velocity = back * (self.rate * step) - (twist.velocity + 1j * w * plane)
        feet = posture.feet_to_torso(Feet(plane - torso, self.height, velocity, self.rise))
        pose = self.legs.pose(feet.plane, feet.height)
        speed = self.legs.speeds(pose, feet.velocity, feet.rise)
        return np.asarray(np.abs(speed).max(axis=(0, 2)) / self.legs.speed_max)

    @np.errstate(over="ignore", invalid="ignore")
    def follow(
        self, command: BodyCommand, home: Plane, torso: complex, absent: Mask
    ) -> BodyCommand:
        """Returns the command with the share of its velocity that the joints can follow (C59).

        absent: (6,) legs that do not walk; other arguments are those of needed().
        """
        check_type(command, BodyCommand, "a BodyCommand", where="command")
        self.asked, self.outrun = command, NO_LEG
        whole = np.array(astuple(command), dtype=np.float64)

        def speeds(share: float) -> Array:
            part = np.concatenate([share * whole[:3], whole[3:]])
            return np.where(absent, 0.0, self.needed(part, home, torso))

        fastest, most = speeds(1.0), FASTEST
        if not (fastest <= most).all():
            most = FASTEST * max(1.0, float(speeds(0.0).max()))
            self.outrun = ~(fastest <= most)
        if not self.outrun.any():
            return command
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if (speeds(middle) <= most).all() else (low, middle)
        vx, vy, yaw_rate = (low * whole[:3]).tolist()
        return replace(command, vx=vx, vy=vy, yaw_rate=yaw_rate)
