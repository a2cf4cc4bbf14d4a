"""From body command and measurement to joint commands, once a period.

    command -> ramp -> foot paths -> rolling -> posture -> inverse kinematics ---------> angle_ref,
    speed_ref
                          ^                                      |                           ^
                        hold                      inverse dynamics -> support -> compliance -+->
                        torque_ref
                          ^------ measured angles, attitude          measured forces --^

Kinematic control is the first line alone: the commands, without any measurement. All of it depends
on the commands alone, so it is planned for many steps at once, in arrays over time; a step takes
the next row and, under compliant control, answers to the forces.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hexapod_cosim.controller.compliant import Compliant
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.gait import Gait
from hexapod_cosim.controller.kinematics import (
    LEGS,
    Array,
    Feet,
    Joints,
    LegSolver,
    Mask,
    Plane,
    Pose,
    rates,
)
from hexapod_cosim.controller.parts import Parts
from hexapod_cosim.controller.posture import in_torso_frame
from hexapod_cosim.controller.trajectory import BodyCommand, CommandRamp, FootPaths
from hexapod_cosim.models import HexapodError, Robot

ALL_PARTS = Parts()
CLOCK_TOLERANCE = 0.01  # 1    of a period, between the time given and the steps counted
# steps at most that are planned at once; nothing depends on it but how time is spread over the
# calls
PLANNED = 128


class ControllerError(HexapodError):
    """A controller that cannot be built, or is called out of step."""


def _zeros() -> Array:
    return np.zeros((LEGS, 3))


def _upright() -> Array:
    return np.array([1.0, 0.0, 0.0, 0.0])


@dataclass
class Measurement:
    """What the robot senses. The arrays belong to the caller, who updates them in place."""

    angle: Array = field(default_factory=_zeros)  # rad    (6, 3)
    speed: Array = field(default_factory=_zeros)  # rad/s    (6, 3)
    foot_force: Array = field(default_factory=_zeros)  # N    (6, 3) ground on foot, world axes
    contact: Mask = field(default_factory=lambda: np.zeros(LEGS, dtype=np.bool_))  # (6,)
    quaternion: Array = field(default_factory=_upright)  # 1    (4,) torso to world, w x y z
    angular_velocity: Array = field(
        default_factory=lambda: np.zeros(3)
    )  # rad/s    (3,) torso, world axes


@dataclass
class JointCommand:
    """What the servos are told. The arrays belong to the controller, which writes them anew at
    every step.
    """

    angle_ref: Array = field(default_factory=_zeros)  # rad    (6, 3)
    speed_ref: Array = field(default_factory=_zeros)  # rad/s    (6, 3)
    torque_ref: Array = field(default_factory=_zeros)  # N m    (6, 3)
    acceleration_ref: Array = field(
        default_factory=_zeros
    )  # rad/s2    (6, 3) planned, for kinematic drives


@dataclass(frozen=True)
class Diagnostics:
    """The controller's insides for recorders and tests: arrays of six legs that change at every
    step.
    """

    swinging: Mask  # planned to be in the air
    # m    (6, 3) the feet's centres as the command plans them, torso frame, without any correction
    planned: Array
    # m    horizontal correction of the feet by the compliance, x + i y in the walking frame
    shift: Plane
    lift: Array  # m    vertical correction, of all parts
    unreachable: Mask  # the joints could not follow at the last step
    # walks without feedback: sensor not believed, or the robot slides, outruns its joints or is far
    # too heavy
    fallback: Mask


def gains_warnings(robot: Robot, gains: Gains | None, period: float) -> tuple[str, ...]:
    """Whether gains are of another robot or period [s], and what they were not designed for."""
    if gains is None:
        return ()
    mismatch = gains.mismatch(robot, period=period)
    return (*(() if mismatch is None else (mismatch,)), *gains.caveats)


class Controller:
    """Walks a robot. `gains` None: kinematic control; else compliant control with these gains.

    `warnings` lists what is doubtful about the set-up (gains of another robot or period); nothing
    in it stops the run. Raises RobotError for a joint pattern without closed-form kinematics,
    ControllerError for an impossible period.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        period: float,
        gait: Gait,
        gains: Gains | None = None,
        parts: Parts = ALL_PARTS,
    ) -> None:
        phases = (gait.duty * gait.period, (1.0 - gait.duty) * gait.period)
        if not 0.0 < period < min(phases):
            raise ControllerError(
                "impossible controller period",
                got=period,
                expected=f"0 < period < {min(phases):g} s, the gait's shorter phase",
                fix="shorten the period or slow the gait",
            )
        self.period, self.gait, self.gains, self.parts = period, gait, gains, parts
        self.legs = LegSolver(robot)
        self.ramp = CommandRamp(gait.period, period=period)
        self.stance = robot.stance
        self.paths = FootPaths(gait, self.legs.forward(self.stance), period=period)
        self.compliant = (
            None
            if gains is None
            else Compliant(robot, gait, gains, parts, legs=self.legs, period=period)
        )
        self.warnings = gains_warnings(robot, gains, period)
        self._out = JointCommand()
        self.diagnostics = self._make_diagnostics()
        self.reset()

    def _make_diagnostics(self) -> Diagnostics:
        compliant, (swinging, lost) = self.compliant, np.zeros((2, LEGS), dtype=np.bool_)
        if compliant is None:
            still = np.zeros(LEGS, dtype=np.complex128), np.zeros(LEGS)
            return Diagnostics(swinging, _zeros(), *still, lost, np.zeros(LEGS, dtype=np.bool_))
        return Diagnostics(
            swinging, _zeros(), compliant.shift, compliant.lift, lost, compliant.laws.fallback
        )

    def reset(self) -> None:
        """Standing in the stance, all memory cleared; the next step is the first."""
        self.ramp.reset()
        self.paths.reset()
        self._start: float | None = None
        self._count, self._cut = 0, True
        if self.compliant is not None:
            self.compliant.reset()
        self._lay_out(0, *self.ramp.ahead(0))

    def save(self) -> dict[str, Any]:
        """Everything the controller remembers between steps, and what it has planned."""
        compliant = None if self.compliant is None else self.compliant.save()
        own = {
            name: getattr(self, name)
            for name in (
                "_start",
                "_count",
                "_plan",
                "_planned",
                "_acceleration",
                "_at",
                "_last",
                "_cut",
            )
        }
        return {
            "ramp": self.ramp.save(),
            "paths": self.paths.save(),
            "compliant": compliant,
            "own": own,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Goes back to a saved state: the steps after it are the same again, bit for bit."""
        self.ramp.restore(state["ramp"])
        self.paths.restore(state["paths"])
        if self.compliant is not None:
            self.compliant.restore(state["compliant"])
        vars(self).update(state["own"])
        self.diagnostics.swinging[:] = self.paths.steps.swinging[-1]

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """The joint commands for [t, t + period). The result's arrays are reused by the next step.

        Args:
            t: time [s]; the first step may come at any time, later ones a period apart. Raises
                ControllerError otherwise.
            command: what the torso should do; changes are ramped over a gait period.
            measurement: sensor values at t; kinematic control does not look at it.
        """
        self._advance(t, command)
        at, out, plan, compliant = self._at, self._out, self._plan, self.compliant
        out.angle_ref[...], out.speed_ref[...], out.acceleration_ref[...] = (
            plan.angle[at],
            plan.speed[at],
            self._acceleration[at],
        )
        self.diagnostics.unreachable[...] = plan.unreachable[at]
        self.diagnostics.planned[...] = self._planned[at]
        if compliant is not None:
            compliant.step(measurement, out)
        return out

    def _advance(self, t: float, command: BodyCommand) -> None:
        """To the planned step at t."""
        due = t if self._start is None else self._start + (self._count + 1) * self.period
        if not abs(t - due) <= CLOCK_TOLERANCE * self.period:
            raise ControllerError(
                "step out of time",
                got=t,
                expected=f"t = {due} s",
                fix="step once per period, or reset the controller",
            )
        if command is not self.ramp.target and command != self.ramp.target:
            self.ramp.aim(command)
            self._last = self._at
        if self._start is None:
            self._start = t
            return
        self._count += 1
        if self._at == self._last:
            with np.errstate(
                over="ignore", invalid="ignore"
            ):  # absurd commands lead to legs that do not reach, and are told so
                self._plan_ahead()
        self._at += 1
        self.paths.advance()
        self.ramp.steps += 1

    def _plan_ahead(self) -> None:
        """Plans what depends on the command alone, up to the next lift-off or touch-down, and
        looks one step further where there is one.
        """
        ramp, target, paths, compliant = self.ramp, self.ramp.target, self.paths, self.compliant
        moves = (target.vx, target.vy, target.yaw_rate) != (0.0, 0.0, 0.0)
        count = PLANNED + 1 if ramp.settled or moves else min(ramp.remaining, PLANNED + 1)
        value, rate = ramp.ahead(count)
        v, yaw_rate = value[:, 0] + 1j * value[:, 1], value[:, 2]
        if compliant is not None:
            compliant.advance(paths.at)
            v, yaw_rate = compliant.steer(
                v, yaw_rate, moves=moves, afresh=self._cut and not paths.left
            )
        paths.plan(v, yaw_rate, going=moves or not ramp.settled)
        end = paths.left + 1
        self._cut = end <= count
        self._lay_out(1, value[:end], rate[:end])
        if end == PLANNED + 2:
            self._last -= 1

    def _lay_out(self, first: int, value: Array, rate: Array) -> None:
        """Turns planned steps, rows of commands and their rates, into joint angles and speeds
        from the row `first` on.
        """
        steps, compliant, rows = self.paths.steps, self.compliant, slice(first, None)
        self.diagnostics.swinging[:] = steps.swinging[-1]  # in all of them the same
        feet = Feet(steps.plane, steps.height, steps.plane_velocity, steps.rise)
        if compliant is not None:
            feet = compliant.lower(feet, steps, walking=self.paths.walking)
        level = not (value[:, 3:].any() or rate[:, 3:].any())
        posture = None if level else (value[:, 3:], rate[:, 3:])
        pose, seen, shift = self._pose(feet, posture)
        joints = self.legs.solve(pose, seen.velocity, seen.rise)
        if compliant is not None:
            compliant.plan(first, steps, value, pose, joints.speed, shift=shift, level=level)
        self._plan = Joints(joints.angle[rows], joints.speed[rows], joints.unreachable[rows])
        self._planned = _centres(
            Feet(steps.plane + shift, steps.height, steps.plane_velocity, steps.rise), posture
        )[rows]
        self._acceleration = self.legs.accelerations(joints, self.period)[rows]
        self._at, self._last = -first, len(value) - first - 1

    def _pose(self, feet: Feet, posture: tuple[Array, Array] | None) -> tuple[Pose, Feet, Plane]:
        """The legs, with the ground rolling off the round foot along the planned path; the feet in
        the torso frame; their shift by that.

        A tibia that pitches by dB rolls its foot's sphere by -R dB along the leg's outward
        direction. The shift s changes B itself: s = R (C + s dC/du), C = q_3 - q_2 less that of the
        stance, is solved by one Newton step.
        """
        seen = feet if posture is None else in_torso_frame(feet, *posture)
        pose = self.legs.pose(seen.plane, seen.height)
        slope = self.legs.speeds(pose, pose.heading, np.zeros(1))
        shift = pose.heading * (
            self.legs.rolling(pose.angles)
            / (1.0 - self.legs.radius * (slope[..., 2] - slope[..., 1]))
        )
        rolling = replace(
            feet, plane=feet.plane + shift, velocity=feet.velocity + rates(shift, self.period)
        )
        seen = rolling if posture is None else in_torso_frame(rolling, *posture)
        return self.legs.pose(seen.plane, seen.height), seen, shift


def _centres(feet: Feet, posture: tuple[Array, Array] | None) -> Array:
    """(n, 6, 3) feet of the walking frame in the torso frame [m], under the commanded height,
    roll and pitch; None: these are 0.
    """
    seen = feet if posture is None else in_torso_frame(feet, *posture)
    return np.stack([seen.plane.real, seen.plane.imag, seen.height], axis=-1)
