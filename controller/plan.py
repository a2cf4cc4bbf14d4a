"""Plans the steps of a walk: three of them, before, at and after the present one. C: plan.h.

    command -> ramp -> foot paths -> rolling -> posture -> inverse kinematics

Speeds, forces and accelerations are differences of successive steps. So every period the step after
the present one is planned, and three steps are kept. When a leg lifts off or touches down, a new
section of the walk begins; no difference reaches across the boundary of two sections.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hexapod_cosim.controller.comply.compliant import Compliant, PresentStep
from hexapod_cosim.controller.gains import Parts
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, rows_of, some
from hexapod_cosim.controller.planned_step import PlannedStep, StepPlanner
from hexapod_cosim.controller.signals import JointCommand
from hexapod_cosim.controller.walk.absence import Absence
from hexapod_cosim.controller.walk.command import BodyCommand, CommandRamp
from hexapod_cosim.controller.walk.foot_paths import FootPaths
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.gait_clock import NO_LEG
from hexapod_cosim.controller.walk.inverse_dynamics import Neighbours
from hexapod_cosim.controller.walk.kinematics import Feet, LegSolver, Pose
from hexapod_cosim.controller.walk.pace import Pace
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.controller.walk.swing import Twist


class WalkPlan(Stateful):
    """The planned steps of one robot in one gait.

    Attributes:
        pace: finds the share of the command that the joints can follow.
        ramp: of this share.
        paths: of the feet.
        at: the present step, counted from the begin of its section.
        last: the step at which the ramp ends, where a new section begins.
        cut: the present step is the last of its section.
        before, now, after: the step before the present one, this one and the next one. None: there
            is none in the section.
        compliant: compliant control, on which the plan depends; None: none.
    """

    STATE = ("pace", "ramp", "paths", "at", "last", "cut", "before", "now", "after", "absence")

    def __init__(
        self,
        gait: Gait,
        parts: Parts,
        *,
        legs: LegSolver,
        period: float,
        compliant: Compliant | None,
    ) -> None:
        """Plans to stand. Constants depend on the gait; period: of the controller [s]."""
        self.legs, self.period, self.compliant = legs, period, compliant
        self.ramp = CommandRamp(gait.period, period=period)
        self.paths = FootPaths(gait, legs, period=period)
        self.pace = Pace(gait, legs, self.paths.home_height)
        if compliant is not None:
            self.paths.clock.handover = compliant.support.handover
        handover = self.paths.clock.handover * gait.period  # s
        self.absence = Absence(legs, self.paths.home, handover=handover, period=period)
        self.planner = StepPlanner(parts, legs=legs, compliant=compliant)
        self.now: PlannedStep
        self.reset()

    def reset(self) -> None:
        """Plans to stand in the stance."""
        self.pace.reset()
        self.ramp.reset()
        self.at, self.last, self.cut = 0, math.inf, True
        self.before: PlannedStep | None = None
        self.after: PlannedStep | None = None
        self.absence.reset()
        self.paths.clock.absent = NO_LEG
        feet = self.paths.reset()
        value, posture, _ = self._look_ahead(0, 0)
        self.now = self.planner.lay_out(value, posture, feet, self.paths.clock, self.absence, 0)

    # ------------------------------------------------------------------------------ the command

    def aim(self, command: BodyCommand) -> bool:
        """Leads the body to a command, as far as the joints can follow it (C59).

        Returns whether the plan no longer applies. Raises HexapodError for no BodyCommand.
        """
        return command != self.pace.asked and self._set_pace(command)

    def _set_pace(self, command: BodyCommand) -> bool:
        """Aims at the share of a command that the joints can follow in the present gait."""
        absence, home = self.absence, self.paths.aims()
        return self.ramp.aim(self.pace.follow(command, home, absence.goal, absence.legs))

    def _look_ahead(self, ahead: int, number: int) -> tuple[Array, Posture, Twist]:
        """Returns command value, posture and body motion `ahead` periods after the present step.

        number: periods since the section began, on which the addition of the slow loops depends.
        """
        value, rate = self.ramp.ahead(ahead)
        drift = self.absence.drift(ahead)
        if drift != 0j:
            value = value + np.array([drift.real, drift.imag, 0.0, 0.0, 0.0, 0.0])
        vx, vy, yaw_rate = value[:3].tolist()
        twist = Twist(complex(vx, vy), yaw_rate)
        if self.compliant is not None:
            added = self.compliant.addition(number)
            twist = Twist(twist.velocity + added.velocity, twist.yaw_rate + added.yaw_rate)
        return value, Posture.of(value[3:], rate[3:]), twist

    def _plan_step(self, number: int, before: PlannedStep) -> PlannedStep:
        """Plans the step `number` periods after the section began; before: the step before it."""
        value, posture, twist = self._look_ahead(1, number)
        feet = self.paths.walk(number, twist, before.feet)
        return self.planner.lay_out(value, posture, feet, self.paths.clock, self.absence, 1)

    def _follow_sensors(self, compliant: Compliant) -> None:
        """Notes which feet have met the ground on their way down (C51), and narrows the stance.

        The steps of a commanded motion aim at the stance that the weight asks for (C53).
        """
        paths = self.paths
        paths.met = paths.clock.swinging & (self.now.feet.rise < 0.0) & compliant.laws.meets()
        if self.ramp.moves():
            paths.narrowing = compliant.adaptation.narrowing

    def _waits(self) -> bool:
        """Returns whether the gait clock waits for feet at the ends of their swings (C50)."""
        clock = self.paths.clock
        if self.compliant is None or clock.absent.sum() > 1:  # a foot of four may have no load
            return False
        return self.compliant.laws.waits(clock.landing(self.at), waiting=clock.waiting)

    def _plan_afresh(self, *, waiting: bool) -> None:
        """Begins a section now, where the clock may be waiting, and plans the step after it."""
        moves, settled = self.ramp.moves(), self.ramp.settled()
        if self.compliant is not None:
            self.compliant.steer(self.at, moves=moves, afresh=self.cut)
        value, posture, twist = self._look_ahead(0, 0)
        going = moves or not settled
        if waiting:
            feet = self.paths.hold(self.now.feet, self.at, twist=twist)
        else:
            feet = self.paths.plan(self.now.feet, self.at, going=going, twist=twist)
        self.now = self.planner.lay_out(value, posture, feet, self.paths.clock, self.absence, 0)
        self.last = math.inf if moves or settled else self.ramp.end - self.ramp.steps
        self.at = 0
        self.after = self._plan_step(1, self.now)

    def advance(self, command_changed: bool) -> None:
        """Makes the planned step the present one, and plans the step after it.

        command_changed: the plan no longer applies, and a new section begins.
        """
        due, clock = command_changed or self.after is None, self.paths.clock
        if self.compliant is not None:
            self._follow_sensors(self.compliant)
        if due or clock.waiting:
            waiting = self._waits()
            if due or not waiting:
                self._plan_afresh(waiting=waiting)
        assert self.after is not None
        self.before, self.now, self.after = self.now, self.after, None
        self.at += 1
        self.ramp.steps += 1
        self.absence.since += 1
        number = self.at + 1
        reached, planned = clock.reach(number), number <= self.last
        reached = reached and not some(self.paths.down(self.now.feet))
        self.cut = planned and not reached
        if reached and planned:
            self.after = self._plan_step(number, self.now)

    # -------------------------------------------------------------- change of gait and control

    def end(self) -> None:
        """Lets the legs finish their steps and begin no other (C55)."""
        self.after = None
        self.paths.clock.ending = self.paths.clock.walking

    def ended(self) -> bool:
        """Returns whether all legs stand and carry their whole loads."""
        clock = self.paths.clock
        full = bool(((self.now.activation >= 1.0) | clock.absent).all())
        return not clock.walking or (clock.ended() and full)

    def lose(self, lost: Mask, bearing: Mask, out: JointCommand) -> bool:
        """Takes lost legs (6,) out of service (C58). Returns whether any is new.

        Legs that stand and can bear a load (6,) wait until no other leg swings.
        """
        clock, absence = self.paths.clock, self.absence
        waits = lost & bearing & ~clock.swinging & ~absence.legs
        waits = waits & (absence.has_room() and some(clock.swinging & ~lost))
        new = absence.change(lost & ~waits, out)
        if new or (some(waits) and not some(clock.dropped)):
            clock.absent = absence.legs
            self.end()
            clock.drop()
        return new

    def adopt(self, before: WalkPlan, returning_leg: int | None = None) -> None:
        """Begins with the standing feet and the command of the plan of another gait (C55).

        returning_leg: a leg that is back in service (C58).
        """
        clock = self.paths.clock
        offset, late = clock.offset, clock.late
        self.restore(before.save())
        self.ramp.carry(before.ramp)
        clock.offset, clock.late = offset, late
        if returning_leg is not None:
            self.absence.take_back(returning_leg)
            clock.absent = self.absence.legs
        self.now = self.now._replace(feet=self.paths.join(self.now.feet, returning_leg))
        self.after, self.at, self.last, self.cut = None, 0, math.inf, True
        self._set_pace(self.pace.asked)

    def carry(self, before: WalkPlan) -> None:
        """Goes on in the phase of the plan under another control, in the same gait."""
        self.restore(before.save())
        self.paths.met = NO_LEG
        if self.compliant is None:
            self.paths.narrowing = 0.0
        self.after, self.cut = None, True

    def _rate_of(self, name: str) -> Any:
        """Returns the rate of a quantity per second by differences, one-sided at section ends."""
        if self.before is None:
            return np.zeros(LEGS)
        before = getattr(self.before, name)
        if self.after is None:
            return (getattr(self.now, name) - before) / self.period
        return (getattr(self.after, name) - before) / (2.0 * self.period)

    def centres(self) -> Array:
        """Returns the planned centres of the feet (6, 3), rolling, not lowered, torso frame [m]."""
        now = self.now
        plane, height = now.posture.to_torso(now.plane, now.feet.height)
        return rows_of(plane.real, plane.imag, height)

    def feet(self) -> Feet:
        """Returns the feet of the present step with rolling and lowering, torso frame."""
        now = self.now
        return now.posture.feet_to_torso(
            Feet(
                plane=now.plane,
                height=now.height,
                velocity=now.feet.velocity - self._rate_of("torso") + self._rate_of("shift"),
                rise=now.feet.rise - self._rate_of("lowering"),
            )
        )

    def lift(self) -> Array:
        """Returns the heights of the paths of the feet (6,) over the stance [m]."""
        height = self.now.feet.height - self.paths.home_height
        return np.where(self.paths.clock.absent, 0.0, height)

    def neighbour(self) -> tuple[Pose | None, float]:
        """Returns the pose after (else before) the present one, and its time from there [s]."""
        if self.after is not None:
            return self.after.pose, self.period
        return None if self.before is None else self.before.pose, -self.period

    def motion(self) -> Neighbours:
        """Returns the masses and poses of the three steps; at section ends, of one alone."""
        before, now, after = self.before, self.now, self.after
        assert now.masses is not None
        if before is None or after is None:
            return Neighbours((None, now.masses, None), (None, now.pose, None))
        return Neighbours(
            (before.masses, now.masses, after.masses), (before.pose, now.pose, after.pose)
        )

    def present_step(self, speed: Array) -> PresentStep:
        """Returns loads and geometry at joint speeds (6, 3) [rad/s] for the laws (C15 to C20)."""
        compliant, now, clock = self.compliant, self.now, self.paths.clock
        assert compliant is not None
        ratio = self.planner.weight_ratio()
        demand = compliant.dynamics.demand(self.motion(), speed, now.posture, ratio)
        feet, height, rise = now.plane, self.lift(), now.feet.rise
        load = compliant.plan(demand, now.activation, clock, feet=feet, height=height, rise=rise)
        return PresentStep(
            load=load,
            climb=self.legs.speeds(now.pose, 0.0, 1.0),
            value=now.value,
            posture=now.posture,
            plane=now.feet.plane,
            torso=now.torso,
            height=now.height,
            rolled=now.feet.rolled,
        )
