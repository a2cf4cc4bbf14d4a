"""Computes joint commands from body command and measurement, once per period. C: controller.c.

    command -> plan (plan.py) -> inverse kinematics ---------------> angle_ref
                 ^                      |                                ^
               hold             inverse dynamics -> support -> compliance -+
                 ^--- measured angles, attitude    measured forces --^     v
                                                                      torque_ref

Kinematic control is the first line alone: it uses no measurement.
"""

from __future__ import annotations

from numbers import Real
from types import NoneType
from typing import Any

import numpy as np

from hexapod_cosim.controller.checks import ControllerError, check_law, check_period
from hexapod_cosim.controller.comply.compliant import Compliant, sense
from hexapod_cosim.controller.comply.paper import Paper, Step
from hexapod_cosim.controller.gains import Gains, Parts
from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plan import WalkPlan
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, some
from hexapod_cosim.controller.sense.health import Health
from hexapod_cosim.controller.signals import Diagnostics, JointCommand, Measurement
from hexapod_cosim.controller.walk.absence import gait_without
from hexapod_cosim.controller.walk.command import BodyCommand
from hexapod_cosim.controller.walk.fade import Fade
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.gait_clock import NO_LEG
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.controller.walk.posture import LEVEL
from hexapod_cosim.models import Robot
from hexapod_cosim.models.errors import check_type

ALL_PARTS = Parts()
STILL: Plane = np.zeros(LEGS, dtype=np.complex128)  # m    no correction along the ground
CLOCK_TOLERANCE = 0.01  # 1    of a period, between the time given and the steps counted


class Controller(Stateful):
    """Walks a robot, under kinematic control or with `gains` under the control that `law` names.

    `warnings` lists problems of the set-up that do not prevent a run, such as gains of another
    robot. Raises RobotError for a joint pattern without closed-form kinematics, ControllerError for
    an impossible period.
    """

    STATE = (
        "plan", "compliant", "paper", "fade", "health", "_start", "_count", "_shown", "_next",
        "_returning_leg",
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
        check_type(robot, Robot, "a Robot, as of load_robot()", where="robot")
        check_type(gains, (Gains, NoneType), "Gains, as of load_gains()", where="gains")
        check_period(period, gait)
        check_law(law)
        self.robot, self.period, self.gains, self.parts = robot, period, gains, parts
        self.legs, self.stance, self.law = LegSolver(robot), robot.stance, law
        self.fade = Fade(period=period)
        self.health = Health(robot, gains, legs=self.legs, period=period)
        self._asked = gait  # that was asked for; without a leg, another one is walked
        self._build(gait)
        self._next: Gait | None = None  # that the legs change to
        self._returning_leg: int | None = None  # leg that is taken back into service then
        self.warnings = gains.warnings(robot, period=period) if gains else ()
        self._out = JointCommand()
        self.diagnostics = Diagnostics()
        self._start: float | None = None  # s    time of the first step
        self._count = 0  # completed steps
        self.reset()

    def _build(self, gait: Gait) -> None:
        """Builds the parts, whose constants depend on the gait."""
        self.gait, robot, gains, parts = gait, self.robot, self.gains, self.parts
        legs, period = self.legs, self.period
        self.compliant: Compliant | None = None
        self.paper: Paper | None = None
        if gains is not None and self.law == "paper":
            self.paper = Paper(robot, gait, gains, parts, legs=legs, period=period)
        elif gains is not None:
            self.compliant = Compliant(robot, gait, gains, parts, legs=legs, period=period)
        self.plan = WalkPlan(gait, parts, legs=legs, period=period, compliant=self.compliant)

    # -------------------------------------------------------------- change of gait and control

    def _adopt(self) -> None:
        """Continues in the next gait once all legs stand and carry their whole loads (C55)."""
        if self._next is None or not self.plan.ended():
            return
        plan, laws, paper = self.plan, self.compliant, self.paper
        self._build(self._next)
        if self.compliant is not None and laws is not None:
            self.compliant.restore(laws.save())
            self.compliant.present = laws.present
        if self.paper is not None and paper is not None:
            self.paper.restore(paper.save())
        self.plan.adopt(plan, self._returning_leg)
        self._next = self._returning_leg = None

    def _change(self, returning_leg: int | None = None) -> None:
        """Begins a change to the gait of the legs in service, with one that comes back (C58)."""
        absent = self.plan.absence.legs & (np.arange(LEGS) != returning_leg)
        backwards = self.plan.ramp.target.vx < 0.0
        self._next = gait_without(self._asked, absent, backwards=backwards)
        self._returning_leg = returning_leg
        self.plan.end()

    def change_gait(self, gait: Gait) -> None:
        """Changes the gait without a jump of the feet, while the robot walks (C55).

        Legs in the air finish their steps, and no other leg lifts off. When all stand, the next
        gait begins with the feet where they are. Raises ControllerError for a gait that is too fast
        for the period, and then changes nothing.
        """
        check_period(self.period, gait)
        self._asked = gait
        self._change()
        self._adopt()

    def _watch(self, measurement: Measurement) -> None:
        """Takes legs that are lost out of service, before the present step is planned (C57)."""
        health, plan = self.health, self.plan
        force = sense(measurement, LEVEL)
        lifted = plan.paths.clock.swinging & (plan.now.feet.rise > 0.0)
        health.step(measurement.angle, force, self._out, lifted)
        if some(health.faulty) and plan.lose(health.lost, health.bearing, self._out):
            self._change()

    def _fold(self, measurement: Measurement) -> None:
        """Folds legs out of service away, and takes back one that works again (C58)."""
        absence, health = self.plan.absence, self.health
        if not some(absence.legs):
            return
        there = absence.fold(measurement.angle, health.faulty, health.locked, self._out)
        self.diagnostics.unreachable[...] &= ~absence.legs
        if some(there) and self._returning_leg is None:
            self._change(int(np.argmax(there)))

    def change_control(self, gains: Gains | None, law: str = "compliant") -> None:
        """Changes the control while the robot walks: arguments as for the constructor.

        The plan of the feet goes on in its phase, under its command; the laws begin anew, and the
        joint commands fade over to those of the next control (fade.py). Before the first step the
        next control begins as after reset(). Raises HexapodError for an unknown law, and then
        changes nothing.
        """
        check_type(gains, (Gains, NoneType), "Gains, as of load_gains()", where="gains")
        check_law(law)
        self.gains, self.law = gains, law
        self.warnings = gains.warnings(self.robot, period=self.period) if gains else ()
        plan, self.health = self.plan, Health(self.robot, gains, legs=self.legs, period=self.period)
        self._build(self.gait)
        if self._start is None:
            self.reset()
            return
        self.plan.carry(plan)
        self.fade.begin(self._out)
        self._show(STILL, np.zeros(LEGS), NO_LEG)
        self.diagnostics.doubted[...] = False

    # --------------------------------------------------------------------------------- joints

    def _follow_paths(self) -> None:
        """Computes the joint commands that move the feet along their paths (C10 to C14)."""
        plan, out, shown = self.plan, self._out, self.diagnostics
        feet = plan.feet()
        joints = self.legs.solve(plan.now.pose, feet.velocity, feet.rise)
        out.angle_ref[...], out.speed_ref[...] = joints.angle, joints.speed
        out.acceleration_ref[...] = self.legs.accelerations(
            *plan.neighbour(), joints.angle, joints.speed
        )
        out.torque_ref[...] = 0.0
        shown.swinging[...] = plan.paths.clock.swinging
        shown.unreachable[...] = joints.unreachable
        shown.planned[...] = plan.centres()

    def _correct_paths(self, paper: Paper, measurement: Measurement) -> None:
        """Corrects the paths by the deviations of the feet, and the commands with them (C49)."""
        plan, out, shown = self.plan, self._out, self.diagnostics
        feet = plan.feet()
        paper.step(
            Step(
                pose=plan.now.pose,
                planned=shown.planned,
                height=plan.lift(),
                rise=feet.rise,
                swinging=plan.paths.clock.swinging | plan.absence.legs,
                angle=measurement.angle,
                force=sense(measurement, LEVEL),
            )
        )
        joints = paper.actuate(feet)
        out.angle_ref[...], out.speed_ref[...] = joints.angle, joints.speed
        shown.unreachable[...] = joints.unreachable
        self._show(paper.shift, paper.lift, NO_LEG)

    def _show(self, shift: Plane, lift: Array, fallback: Mask) -> None:
        """Copies corrections of the feet (6,) [m] and fallbacks (6,) into the diagnostics."""
        shown = self.diagnostics
        shown.shift[...], shown.lift[...], shown.fallback[...] = shift, lift, fallback
        self._shown = shift, lift, fallback

    # ---------------------------------------------------------------------------------- steps

    def reset(self) -> None:
        """Puts the robot in its stance and clears all memory; the next step is the first."""
        self._returning_leg = None
        if self.gait != self._asked:
            self._build(self._asked)
        for part in (self.compliant, self.paper, self.fade, self.health, self.plan):
            if part is not None:
                part.reset()
        self._start, self._count, self._next = None, 0, None
        self._shown = STILL, np.zeros(LEGS), NO_LEG
        self._follow_paths()

    def save(self) -> dict[str, Any]:
        """Returns the state that restore() takes; it includes gait and control."""
        gaits = {"gait": self.gait, "asked": self._asked}
        return super().save() | gaits | {"control": (self.gains, self.law)}

    def restore(self, state: dict[str, Any]) -> None:
        """Restores a state returned by save(); the following steps repeat exactly.

        Raises ControllerError for anything else.
        """
        if missing := self.save().keys() - state.keys():
            raise ControllerError(
                "not a controller's state",
                got=f"no {', '.join(sorted(missing))}",
                expected="what save() returned",
                fix="pass it unchanged",
            )
        control = self.gains, self.law
        if (state["gait"], state["control"]) != (self.gait, control):
            self.gains, self.law = state["control"]
            self._build(state["gait"])
        self._asked = state["asked"]
        own = {name: value for name, value in state.items() if name in self.STATE}
        super().restore(own)
        self._follow_paths()
        self._show(*self._shown)

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        """Returns the joint commands for [t, t + period). The next step reuses the arrays.

        Args:
            t: time [s]. The first step may be at any time; each later one is a period after the
                step before.
            command: desired motion of the torso; changes are ramped over a gait period.
            measurement: sensor values at t; kinematic control does not use them.

        Raises:
            HexapodError: t is not the time of the next step, or an argument has another type.
        """
        check_type(t, Real, "a time [s]", where="t")
        check_type(measurement, Measurement, "a Measurement", where="measurement")
        first = self._start is None
        due = t if self._start is None else self._start + (self._count + 1) * self.period
        if not abs(t - due) <= CLOCK_TOLERANCE * self.period:
            raise ControllerError(
                "step out of time",
                got=t,
                expected="a finite time [s]" if first else f"t = {due} s",
                fix="step once per period, or reset the controller",
            )
        command_changed = self.plan.aim(command)
        # extreme commands overflow; the legs do not reach such targets, and this is reported
        with np.errstate(over="ignore", invalid="ignore"):
            if first:  # the first step is the stance itself, for every command
                self._start = t
            else:
                self._count += 1
                if self.gains is not None:
                    self._watch(measurement)
                self.plan.advance(command_changed)
            self._follow_paths()
            self._apply_laws(measurement)
            self.fade.step(self.legs, self._out)
            self._fold(measurement)
            self.diagnostics.absent[...] = self.plan.absence.legs
            self.diagnostics.outrun[...] = self.plan.pace.outrun
            self.diagnostics.faulty[...] = self.health.faulty.T
            self._adopt()
        return self._out

    def _apply_laws(self, measurement: Measurement) -> None:
        """Corrects the joint commands by the measurement, under compliant or paper control."""
        if self.paper is not None:
            self._correct_paths(self.paper, measurement)
        if self.compliant is not None:
            step = self.plan.present_step(self._out.speed_ref)
            raised = self.compliant.step(step, measurement, self._out)
            self._show(STILL, raised, self.compliant.laws.fallback)
            self.diagnostics.doubted[...] = self.compliant.laws.doubted
