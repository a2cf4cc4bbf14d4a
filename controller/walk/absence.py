"""Walks without legs that are out of service, and takes them back (C58). C: absence.h.

A leg with a faulty servo is folded away by its other joints, and faulty servos are tried all the
time by a small swing of their commands. The others walk a wave without it, as fast as their
reach allows, under a torso whose centre is over the centre of their feet.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, clamp
from hexapod_cosim.controller.signals import JointCommand
from hexapod_cosim.controller.walk.gait import PATTERNS, Gait
from hexapod_cosim.controller.walk.kinematics import LegSolver

MOST_ABSENT = 2  # legs: four must walk
SWIFT, LOW_STEP = 0.6, 0.6  # 1    swing time and step height without a leg over those of the gait
SHIFT_TIME = 0.4  # s    in which the torso moves over the other feet
BACK_TIME = 3.0  # s    in which the walk then takes the torso back to its path
FAR_SHIFT = 0.045  # m    at most for each lost leg
FOLD_SPEED = 4.0  # rad/s
LEAD = 0.15  # rad    of a command before its joint, at most
FOLD_MARGIN = 0.1  # rad    of a folded joint from its limit
TRIAL_SWING, TRIAL_TIME = 0.08, 1.0  # rad, s    size and period of the swing of a faulty joint
ARRIVED = 1e-3  # rad    a command this near to the plan is the plan
# leg that steps first without a leg, forwards and backwards: without the foremost of a side the
# rearmost one there, so that the feet beside the torso step before it stands on them alone
FIRST = np.array([[2, 4, 3, 5, 1, 0], [5, 4, 0, 2, 1, 3]])


def gait_without(gait: Gait, absent: Mask, *, backwards: bool) -> Gait:
    """Returns the wave of the legs that are not absent (6,), or the gait if none is."""
    if not absent.any():
        return gait
    phases, turn = PATTERNS["wave"].offsets, 1.0 if backwards else -1.0
    begin = phases[FIRST[int(backwards)][int(np.argmax(absent))]]
    order = sorted(np.flatnonzero(~absent), key=lambda leg: turn * (phases[leg] - begin) % 1.0)
    # an absent leg gives up its load while it stands by the clock
    count, offsets = len(order), np.full(LEGS, 0.5)
    offsets[order] = -np.arange(count) / count % 1.0
    swing = SWIFT * gait.period * (1.0 - gait.duty)
    return Gait(
        name=gait.name,
        period=count * swing,
        duty=(count - 1) / count,
        offsets=tuple(offsets.tolist()),
        step_height=LOW_STEP * gait.step_height,
        touchdown_speed=gait.touchdown_speed,
    )


def folded(legs: LegSolver, faulty: Mask, locked: Mask) -> Array:
    """Returns the joint angles (6, 3) at which legs are out of the way [rad].

    The femur is raised. The tibia is folded under a limp femur, which hangs down, and raised on a
    locked one.

    faulty, locked: (6, 3) servos that do not work, and of these the ones that do not move.
    """
    low, high = legs.angle_min + FOLD_MARGIN, legs.angle_max - FOLD_MARGIN
    pose = legs.stance.copy()
    pose[:, 1] = high[:, 1]
    tibia = np.where(locked[:, 1], low[:, 2], high[:, 2])
    pose[:, 2] = np.where(faulty[:, 1], tibia, pose[:, 2])
    return pose


class Absence(Stateful):
    """Legs out of service, and the way of the torso because of them.

    Attributes:
        legs: (6,) out of service.
        command: (6, 3) commanded angles of these legs [rad].
        place: (6, 3) angles around which their faulty joints are tried [rad].
        since: periods since the legs out of service changed (scalar).
        begin, goal: ways of the torso from its nominal place, walking frame, x + i y (scalars) [m].
        gone: (6,) that were out of service before.
        trial: periods since the begin, for the trial (scalar).
    """

    STATE = ("legs", "command", "place", "since", "begin", "goal", "gone", "trial")

    def __init__(self, legs: LegSolver, home: Plane, *, handover: float, period: float) -> None:
        """Starts with all legs. home: (6,) feet of the stance [m]; handover: of a load [s]."""
        self.solver, self.home, self.period = legs, home, period
        self.handover = max(handover, period)
        self.reset()

    def reset(self) -> None:
        """Takes all legs back at once."""
        none = np.zeros(LEGS, dtype=np.bool_)
        self.legs, self.gone = none, none
        self.command, self.place = np.zeros((2, LEGS, 3))
        self.since = round((SHIFT_TIME + BACK_TIME) / self.period) + 1
        self.trial, self.begin, self.goal = 0, 0j, 0j

    def has_room(self) -> bool:
        """Returns whether another leg may be taken out of service."""
        return int(self.legs.sum()) < MOST_ABSENT

    def change(self, lost: Mask, out: JointCommand) -> bool:
        """Takes lost legs (6,) out of service, at most MOST_ABSENT. Returns whether any is new.

        out: the last joint commands.
        """
        new = lost & ~self.legs
        new = new & (np.cumsum(new) <= MOST_ABSENT - self.legs.sum())
        if not new.any():
            return False
        self.command = np.where(new[:, None], out.angle_ref, self.command)
        self.place = np.where(new[:, None], out.angle_ref, self.place)
        self._set(self.legs | new)
        return True

    def take_back(self, leg: int) -> None:
        """Takes a leg back into service."""
        self._set(self.legs & (np.arange(LEGS) != leg))

    def _set(self, legs: Mask) -> None:
        self.begin, self.gone = self.torso(0), self.legs
        goal = complex(self.home[~legs].mean() - self.home.mean())
        most = FAR_SHIFT * max(legs.sum(), 1)
        self.goal = goal * (most / max(abs(goal), most))
        self.legs, self.since = legs, 0

    def torso(self, ahead: int) -> complex:
        """Returns the way of the torso `ahead` periods after the present step [m]."""
        x = min((self.since + ahead) * self.period / SHIFT_TIME, 1.0)
        return self.begin + (self.goal - self.begin) * (x * x * (3.0 - 2.0 * x))

    def drift(self, ahead: int) -> complex:
        """Returns the velocity that leads the torso back to its path `ahead` periods later [m/s].

        Its nominal place moves as far as the torso has moved from there, in the other direction.
        """
        x = ((self.since + ahead) * self.period - SHIFT_TIME) / BACK_TIME
        if not 0.0 < x < 1.0:
            return 0j
        return (self.begin - self.goal) * (6.0 * x * (1.0 - x) / BACK_TIME)

    def presence(self, ahead: int) -> Array:
        """Returns the factors (6,) on the activations of the legs `ahead` periods later."""
        x = min((self.since + ahead) * self.period / self.handover, 1.0)
        left = 0.0 if x >= 1.0 else 1.0 - x * x * (3.0 - 2.0 * x)
        return np.where(self.legs, np.where(self.gone, 0.0, left), 1.0)

    def fold(self, angle: Array, faulty: Mask, locked: Mask, out: JointCommand) -> Mask:
        """Replaces the commands of the legs out of service, in place.

        Legs without a faulty servo return to the plan. Returns the legs (6,) that are there.

        angle: (6, 3) measured [rad]; faulty, locked: (6, 3) servos.
        """
        lost = np.asarray(faulty.any(axis=1))
        swing = TRIAL_SWING * math.sin(math.tau * self.trial * self.period / TRIAL_TIME)
        self.trial += 1
        target = folded(self.solver, faulty, locked)
        target = np.where(faulty, np.where(locked, self.place, target) + swing, target)
        target = np.where(lost[:, None], target, out.angle_ref)
        target = clamp(target, self.solver.angle_min, self.solver.angle_max)
        step = FOLD_SPEED * self.period
        moved = self.command + clamp(target - self.command, -step, step)
        moved = clamp(moved, angle - LEAD, angle + LEAD)
        rate = (moved - self.command) / self.period
        back = self.legs & ~lost & (np.abs(moved - out.angle_ref) < ARRIVED).all(axis=1)
        away = self.legs[:, None]
        self.command = np.where(away, moved, self.command)
        out.angle_ref[...] = np.where(away, moved, out.angle_ref)
        out.speed_ref[...] = np.where(away, rate, out.speed_ref)
        out.torque_ref[...] = np.where(away, 0.0, out.torque_ref)
        return np.asarray(back)
