"""Computes joint commands from body command and measurement, once per period. C: controller.c.

    command -> ramp -> foot paths -> rolling -> posture -> inverse kinematics ---------> angle_ref
                          ^                                      |                           ^
                        hold                      inverse dynamics -> support -> compliance -+
                          ^--- measured angles, attitude        measured forces --^          v
                                                                                        torque_ref

Kinematic control is the first line alone: it uses no measurement. Speeds, forces and accelerations
are differences of successive steps. So every period the step after the present one is planned, and
three steps are kept: before, now and after. When a leg lifts off or touches down, a new section of
the walk begins; no difference reaches across the boundary of two sections.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from hexapod_cosim.controller.comply.compliant import Compliant, Stance, sense
from hexapod_cosim.controller.comply.paper import Paper, Step
from hexapod_cosim.controller.comply.posture import LEVEL, Posture
from hexapod_cosim.controller.gains import Gains
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.parts import Parts
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, cis, rows_of
from hexapod_cosim.controller.signals import Diagnostics, JointCommand, Measurement
from hexapod_cosim.controller.walk.fade import Fade
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.inverse_dynamics import Masses, Neighbours
from hexapod_cosim.controller.walk.kinematics import Feet, LegSolver, Pose
from hexapod_cosim.controller.walk.trajectory import (
    BodyCommand,
    CommandRamp,
    FootPaths,
    PlannedFeet,
    Twist,
)
from hexapod_cosim.models import HexapodError, Robot, unknown_name

ALL_PARTS = Parts()
LAWS = ("compliant", "paper")  # what the feet's forces do; without gains control is kinematic
NO_LEG: Mask = np.zeros(LEGS, dtype=np.bool_)
CLOCK_TOLERANCE = 0.01  # 1    of a period, between the time given and the steps counted


class ControllerError(HexapodError):
    """The controller cannot be built, or was called at a wrong time."""


class PlannedStep(NamedTuple):
    """One planned step, which depends on the command alone. Feet (6,) are in the walking frame."""

    value: Array  # (6,) commanded vx vy yaw_rate height roll pitch
    posture: Posture
    feet: PlannedFeet
    sway: complex  # m    way of the torso against the swinging legs (C54)
    plane: Plane  # m    of the feet from the torso that sways
    activation: Array  # 1    of the legs
    lowering: Array  # m    lowering of the feet by the indentation of the ground (C21)
    height: Array  # m    of the lowered feet
    shift: Plane  # m    of the feet due to rolling (C9)
    pose: Pose  # of the legs
    masses: Masses | None  # of the links; None under kinematic control


def _check_period(period: float, gait: Gait) -> None:
    """Raises ControllerError unless stance and swing of the gait are longer than the period [s]."""
    shorter = gait.period * min(gait.duty, 1.0 - gait.duty)
    if not 0.0 < period < shorter:
        raise ControllerError(
            "impossible controller period",
            got=period,
            expected=f"0 < period < {shorter:g} s, the gait's shorter phase",
            fix="shorten the period or slow the gait",
        )


def _check_law(law: str) -> None:
    """Raises HexapodError for an unknown name."""
    if law not in LAWS:
        raise unknown_name("law", law, LAWS)


def gains_warnings(robot: Robot, gains: Gains | None, period: float) -> tuple[str, ...]:
    """Returns warnings of gains for another robot or period [s], and the caveats of the gains."""
    if gains is None:
        return ()
    mismatch = gains.mismatch(robot, period=period)
    return (*(() if mismatch is None else (mismatch,)), *gains.caveats)


class Controller(Stateful):
    """Walks a robot, under kinematic control or with `gains` under the control that `law` names.

    `warnings` lists problems of the set-up that do not prevent a run, such as gains of another
    robot. Raises RobotError for a joint pattern without closed-form kinematics, ControllerError for
    an impossible period.
    """

    STATE = (
        "ramp", "paths", "compliant", "paper", "fade", "_start", "_count", "_at", "_last", "_cut",
        "_before", "_now", "_after", "_shown", "_next",
    )  # fmt: skip

    def __init__(
        self,
        robot: Robot,
        *,
        period: float,
        gait: Gait,
        gains: Gains | None = None,
        parts: Parts = ALL_PARTS,
        law: str = "compliant",
    ) -> None:
        _check_period(period, gait)
        _check_law(law)
        self.robot, self.period, self.gains, self.parts = robot, period, gains, parts
        self.legs, self.stance, self.law = LegSolver(robot), robot.stance, law
        self.fade = Fade(period=period)
        self._build(gait)
        self._next: Gait | None = None  # that the legs change to
        self.warnings = gains_warnings(robot, gains, period)
        self._out = JointCommand()
        self.diagnostics = Diagnostics()
        self._start: float | None = None  # s    time of the first step
        self._count = 0  # completed steps
        self._at = 0  # the present step, counted from the begin of its section
        self._last = math.inf  # the step at which the ramp ends, where a new section begins
        self._cut = True  # the present step is the last of its section
        self._before: PlannedStep | None = None
        self._now: PlannedStep
        self._after: PlannedStep | None = None
        self.reset()

    def _build(self, gait: Gait) -> None:
        """Builds the parts, whose constants depend on the gait."""
        self.gait, period = gait, self.period
        self.ramp = CommandRamp(gait.period, period=period)
        home = self.legs.forward(self.stance)
        inward = -gait.narrowing * cis(self.legs.hip_yaw + self.stance[:, 0])
        narrow = self.legs.pose(home[:, 0] + 1j * home[:, 1] + inward, home[:, 2])
        turned = self.legs.rolling(narrow.angle)
        self.paths = FootPaths(
            gait,
            home,
            period=period,
            inward=inward,
            turned=turned,
        )
        self.compliant: Compliant | None = None
        self.paper: Paper | None = None
        if self.gains is not None and self.law == "paper":
            self.paper = Paper(
                self.robot, gait, self.gains, self.parts, legs=self.legs, period=period
            )
        elif self.gains is not None:
            self.compliant = Compliant(
                self.robot, gait, self.gains, self.parts, legs=self.legs, period=period
            )
            self.paths.handover = self.compliant.support.handover

    # ------------------------------------------------------------------------------- planning

    def _look_ahead(self, ahead: int, number: int) -> tuple[Array, Posture, Twist]:
        """Returns command value, posture and body motion `ahead` periods after the present step.

        number: periods since the section began, on which the addition of the slow loops depends.
        """
        value, rate = self.ramp.ahead(ahead)
        vx, vy, yaw_rate = value[:3].tolist()
        twist = Twist(complex(vx, vy), yaw_rate)
        if self.compliant is not None:
            added = self.compliant.addition(number)
            twist = Twist(twist.velocity + added.velocity, twist.yaw_rate + added.yaw_rate)
        return value, Posture.of(value[3:], rate[3:]), twist

    def _lower(self, feet: PlannedFeet, plane: Plane) -> tuple[Array, Array]:
        """Returns the activations of the legs (6,) and the lowering of their feet (6,) [m].

        plane: (6,) of the feet from the torso that sways [m].
        """
        if self.compliant is None:
            return np.ones(LEGS), np.zeros(LEGS)
        support, paths = self.compliant.support, self.paths
        activation = support.activation(
            feet.phase, paths.stayed, paths.stays, walking=paths.walking
        )
        activation = np.where(paths.awaited, 0.0, activation)
        if not self.parts.support:
            return activation, np.zeros(LEGS)
        return activation, support.lowering(plane, activation)

    def place_legs(
        self, posture: Posture, plane: Plane, height: Array, rolled: Array
    ) -> tuple[Plane, Pose]:
        """Returns the shift of the feet due to rolling (C9) [m], and the pose of the legs.

        A tibia that pitches by dB rolls the sphere of its foot by -R dB along the outward direction
        of the leg. The shift s changes B itself: s = R (C + s dC/du) is solved by one Newton step.

        Args:
            posture: of the torso.
            plane, height: (..., 6) centres of the feet, walking frame [m].
            rolled: (6,) distances rolled that are no shift, because the feet aim at another
                position than that of the stance [m].
        """
        legs = self.legs
        pose = legs.pose(*posture.see_place(plane, height))
        slope = legs.speeds(pose, pose.heading, 0.0)
        turns = slope[..., 2] - slope[..., 1]
        rolls = legs.rolling(pose.angle) - rolled
        shift = pose.heading * (rolls / (1.0 - legs.radius * turns))
        return shift, legs.pose(*posture.see_place(plane + shift, height))

    def _stand(
        self, value: Array, posture: Posture, feet: PlannedFeet, sway: complex
    ) -> PlannedStep:
        """Computes the pose of the legs and the point masses for a torso that has moved by `sway`.

        sway: in the walking frame [m].
        """
        plane = feet.plane - sway
        activation, lowering = self._lower(feet, plane)
        height = feet.height - lowering
        shift, pose = self.place_legs(posture, plane, height, feet.rolled)
        masses = None
        if self.compliant is not None:
            way = feet.way + cis(feet.turn) * sway
            masses = self.compliant.dynamics.place(pose, way, feet.turn, posture)
        return PlannedStep(
            value=value,
            posture=posture,
            feet=feet,
            sway=sway,
            plane=plane,
            activation=activation,
            lowering=lowering,
            height=height,
            shift=shift,
            pose=pose,
            masses=masses,
        )

    def _lay_out(self, value: Array, posture: Posture, feet: PlannedFeet) -> PlannedStep:
        """Computes sway, pose of the legs and point masses for planned feet."""
        sway, compliant = 0j, self.compliant
        if compliant is not None and compliant.sway.acts(compliant.adaptation):
            guess = compliant.sway.guess(feet, compliant.adaptation)
            masses = self._stand(value, posture, feet, guess).masses
            assert masses is not None
            sway = compliant.sway.of(guess, masses, compliant.adaptation)
        return self._stand(value, posture, feet, sway)

    def _plan_step(self, number: int, ahead: int, before: PlannedStep) -> PlannedStep:
        """Plans the step `number` periods after the section began.

        ahead: periods from the present step to it; before: the step before it.
        """
        value, posture, twist = self._look_ahead(ahead, number)
        return self._lay_out(value, posture, self.paths.walk(number, twist, before.feet))

    def _note_contacts(self) -> None:
        """Notes which feet have met the ground on their way down (C51)."""
        if self.compliant is not None:
            falling = self.paths.swinging & (self._now.feet.rise < 0.0)
            self.paths.met = falling & self.compliant.laws.meets()

    def _narrow(self) -> None:
        """Aims the steps of a commanded motion at the stance that the weight asks for (C53)."""
        if self.compliant is not None and self.ramp.moves():
            self.paths.narrowing = self.compliant.adaptation.narrowing

    def _waits(self) -> bool:
        """Returns whether the gait clock waits for feet at the ends of their swings (C50)."""
        if self.compliant is None:
            return False
        landing = self.paths.landing(self._at)
        return self.compliant.laws.waits(landing, held=self.paths.held)

    def _plan_afresh(self, *, waiting: bool) -> None:
        """Begins a new section at the present step, and plans the step after it.

        waiting: the gait clock stands still in it.
        """
        moves, settled = self.ramp.moves(), self.ramp.settled()
        if self.compliant is not None:
            self.compliant.steer(self._at, moves=moves, afresh=self._cut)
        value, posture, twist = self._look_ahead(0, 0)
        going = moves or not settled
        if waiting:
            feet = self.paths.hold(self._now.feet, self._at, twist=twist)
        else:
            feet = self.paths.plan(self._now.feet, self._at, going=going, twist=twist)
        self._now = self._lay_out(value, posture, feet)
        self._last = math.inf if moves or settled else self.ramp.end - self.ramp.steps
        self._at = 0
        self._after = self._plan_step(1, 1, self._now)

    def _advance(self, command_changed: bool) -> None:
        """Makes the planned step the present one, and plans the step after it.

        command_changed: the plan no longer applies, and a new section begins.
        """
        due = command_changed or self._after is None
        self._note_contacts()
        self._narrow()
        if due or self.paths.held:
            waiting = self._waits()
            if due or not waiting:
                self._plan_afresh(waiting=waiting)
        assert self._after is not None
        self._before, self._now, self._after = self._now, self._after, None
        self._at += 1
        self.ramp.steps += 1
        number = self._at + 1
        reached, planned = self.paths.reach(number), number <= self._last
        self._cut = planned and not reached
        if reached and planned:
            self._after = self._plan_step(number, 1, self._now)

    # ------------------------------------------------------------------------- change of gait

    def _adopt(self) -> None:
        """Continues in the next gait once all legs stand and carry their whole loads (C55)."""
        full = bool((self._now.activation >= 1.0).all())
        if self._next is None or (self.paths.walking and not (self.paths.ended() and full)):
            return
        before, law, state = self.ramp, self.compliant, super().save()
        self._build(self._next)
        offset, late = self.paths.offset, self.paths.late
        super().restore(state)
        if self.compliant is not None and law is not None and hasattr(law, "stance"):
            self.compliant.stance = law.stance
        self.ramp.carry(before)
        self.paths.offset, self.paths.late = offset, late
        self._now = self._now._replace(feet=self.paths.join(self._now.feet))
        self._next, self._after, self._at, self._last, self._cut = None, None, 0, math.inf, True

    def change_gait(self, gait: Gait) -> None:
        """Changes the gait without a jump of the feet, while the robot walks (C55).

        Legs in the air finish their steps, and no other leg lifts off. When all stand, the next
        gait begins with the feet where they are. Raises ControllerError for a gait that is too fast
        for the period, and then changes nothing.
        """
        _check_period(self.period, gait)
        self._next, self._after = gait, None
        self.paths.ending = self.paths.walking
        self._adopt()

    # ----------------------------------------------------------------------- change of control

    def _exchange(self) -> None:
        """Goes on under the control of the present gains and law in the phase of the walk."""
        state = super().save()
        del state["compliant"], state["paper"]  # the laws begin anew
        self._build(self.gait)
        super().restore(state)
        self.fade.begin(self._out)
        self.paths.carry()
        if self.compliant is None:
            self.paths.narrowing = 0.0
        self._show(np.zeros((LEGS, 3)), NO_LEG)
        self._after, self._cut = None, True

    def change_control(self, gains: Gains | None, law: str = "compliant") -> None:
        """Changes the control while the robot walks: arguments as for the constructor.

        The plan of the feet goes on in its phase, under its command; the laws begin anew, and the
        joint commands fade over to those of the next control (fade.py). Before the first step the
        next control begins as after reset(). Raises HexapodError for an unknown law, and then
        changes nothing.
        """
        _check_law(law)
        self.gains, self.law = gains, law
        self.warnings = gains_warnings(self.robot, gains, self.period)
        if self._start is not None:
            self._exchange()
            return
        self._build(self.gait)
        self.reset()

    # --------------------------------------------------------------------------------- joints

    def _rate_of(self, name: str) -> Any:
        """Returns the rate of a quantity per second by differences, one-sided at section ends."""
        if self._before is None:
            return np.zeros(LEGS)
        before = getattr(self._before, name)
        if self._after is None:
            return (getattr(self._now, name) - before) / self.period
        return (getattr(self._after, name) - before) / (2.0 * self.period)

    def _show_planned(self) -> Array:
        """Returns the planned centres of the feet (6, 3), torso frame [m].

        They are those of the paths with the shift due to rolling, without the lowering.
        """
        now = self._now
        plane, height = now.posture.see_place(now.plane + now.shift, now.feet.height)
        return rows_of(plane.real, plane.imag, height)

    def _planned_feet(self) -> Feet:
        """Returns the feet of the present step with rolling and lowering, walking frame."""
        now = self._now
        return Feet(
            plane=now.plane + now.shift,
            height=now.height,
            velocity=now.feet.velocity - self._rate_of("sway") + self._rate_of("shift"),
            rise=now.feet.rise - self._rate_of("lowering"),
        )

    def _follow_paths(self) -> None:
        """Computes the joint commands that move the feet along their paths (C10 to C14)."""
        now, out, shown = self._now, self._out, self.diagnostics
        seen = now.posture.see(self._planned_feet())
        joints = self.legs.solve(now.pose, seen.velocity, seen.rise)
        neighbour, ahead = self._after or self._before, self.period
        if self._after is None:
            ahead = -ahead
        out.angle_ref[...], out.speed_ref[...] = joints.angle, joints.speed
        out.acceleration_ref[...] = self.legs.accelerations(
            None if neighbour is None else neighbour.pose, ahead, joints.angle, joints.speed
        )
        out.torque_ref[...] = 0.0
        shown.swinging[...] = self.paths.swinging
        shown.unreachable[...] = joints.unreachable
        shown.planned[...] = self._show_planned()

    def _correct_paths(self, paper: Paper, measurement: Measurement) -> None:
        """Corrects the paths by the deviations of the feet, and the commands with them (C49)."""
        now, out, shown = self._now, self._out, self.diagnostics
        feet = now.posture.see(self._planned_feet())
        paper.step(
            Step(
                pose=now.pose,
                planned=shown.planned,
                height=now.feet.height - self.paths.home_height,
                rise=feet.rise,
                swinging=self.paths.swinging,
                angle=measurement.angle,
                force=sense(measurement, LEVEL),
            )
        )
        joints = paper.actuate(feet)
        out.angle_ref[...], out.speed_ref[...] = joints.angle, joints.speed
        shown.unreachable[...] = joints.unreachable
        shift = paper.shift
        self._show(rows_of(shift.real, shift.imag, paper.lift), NO_LEG)

    def _ask(self, compliant: Compliant) -> Stance:
        """Returns planned loads and geometry of the present step for the laws (C15 to C20)."""
        before, now, after, speed = self._before, self._now, self._after, self._out.speed_ref
        assert now.masses is not None
        motion = Neighbours((None, now.masses, None), (None, now.pose, None))
        if before is not None and after is not None:
            motion = Neighbours(
                (before.masses, now.masses, after.masses), (before.pose, now.pose, after.pose)
            )
        laden = compliant.sway.laden(compliant.adaptation)
        demand = compliant.dynamics.demand(motion, speed, now.posture, laden)
        feet = now.plane + now.shift
        plan = compliant.laws.plan(
            demand,
            compliant.shares(feet, now.activation, demand),
            feet=feet,
            height=now.feet.height - self.paths.home_height,
            rise=now.feet.rise,
            swinging=self.paths.swinging,
            awaited=self.paths.awaited,
            overspeed=bool((np.abs(speed) >= self.legs.speed_max).any()),
        )
        climb = self.legs.speeds(now.pose, 0.0, 1.0)
        return Stance(
            plan=plan,
            climb=climb,
            value=now.value,
            posture=now.posture,
            plane=now.feet.plane,
            sway=now.sway,
            height=now.height,
            rolled=now.feet.rolled,
        )

    # ---------------------------------------------------------------------------------- steps

    def reset(self) -> None:
        """Puts the robot in its stance and clears all memory; the next step is the first."""
        self.ramp.reset()
        if self.compliant is not None:
            self.compliant.reset()
        if self.paper is not None:
            self.paper.reset()
        self.fade.reset()
        self._start = None
        self._count, self._at, self._last, self._cut = 0, 0, math.inf, True
        feet = self.paths.reset()
        value, posture, _ = self._look_ahead(0, 0)
        self._before, self._after = None, None
        self._now = self._lay_out(value, posture, feet)
        self._shown = np.zeros((LEGS, 3)), NO_LEG
        self._next = None
        self._follow_paths()

    def save(self) -> dict[str, Any]:
        """Returns the state that restore() takes; it includes gait and control."""
        return super().save() | {"gait": self.gait, "control": (self.gains, self.law)}

    def restore(self, state: dict[str, Any]) -> None:
        """Restores a state returned by save(); the following steps repeat exactly."""
        control = self.gains, self.law
        if (state["gait"], state["control"]) != (self.gait, control):
            self.gains, self.law = state["control"]
            self._build(state["gait"])
        own = {name: value for name, value in state.items() if name in self.STATE}
        super().restore(own)
        self._follow_paths()
        self._show(*self._shown)

    def _show(self, shift: Array, fallback: Mask) -> None:
        """Copies corrections of the feet (6, 3) [m] and fallbacks (6,) into the diagnostics."""
        shown = self.diagnostics
        shown.shift[...], shown.lift[...] = shift[:, 0] + 1j * shift[:, 1], shift[:, 2]
        shown.fallback[...] = fallback
        self._shown = shift, fallback

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for [t, t + period). The next step reuses the arrays.

        Args:
            t: time [s]. The first step may be at any time; each later one is a period after the
                step before.
            command: desired motion of the torso; changes are ramped over a gait period.
            measurement: sensor values at t; kinematic control does not use them.

        Raises:
            ControllerError: t is not the time of the next step.
        """
        first = self._start is None
        due = t if self._start is None else self._start + (self._count + 1) * self.period
        if not abs(t - due) <= CLOCK_TOLERANCE * self.period:
            raise ControllerError(
                "step out of time",
                got=t,
                expected=f"t = {due} s",
                fix="step once per period, or reset the controller",
            )
        command_changed = self.ramp.aim(command)
        # extreme commands overflow; the legs do not reach such targets, and this is reported
        with np.errstate(over="ignore", invalid="ignore"):
            if first:  # the first step is the stance itself, for every command
                self._start = t
            else:
                self._count += 1
                self._advance(command_changed)
            self._follow_paths()
            if self.paper is not None:
                self._correct_paths(self.paper, measurement)
            if self.compliant is not None:
                raised = self.compliant.step(self._ask(self.compliant), measurement, self._out)
                still = np.zeros(LEGS)
                self._show(rows_of(still, still, raised), self.compliant.laws.fallback)
            self.fade.step(self.legs, self._out)
            self._adopt()
        return self._out
