"""Computes the paths of the feet from the body command. C: trajectory.h.

The walking frame K is the torso frame of a robot at its nominal height and level posture. It moves
over the ground with the velocity v = vx + i vy and the yaw rate w. Horizontal points are complex
numbers p = x + i y. The ground frame is the walking frame at the begin of the walk.

A swinging foot moves from the ground point that it left to the ground point where it will be
half-way through the next stance under its stance position. Both points are fixed to the ground, so
a blend (C6) whose ends have neither speed nor acceleration lets the foot leave and meet the ground
without sliding. The flat top of the blend keeps the peak speed at 1.41 times the mean; the quintic
of least jerk needs 1.88 and a cycloid 2, which the joints of small servos do not reach.
"""

from __future__ import annotations

import itertools
from dataclasses import astuple, dataclass
from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, cis
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.models import HexapodError

DWELL = 0.1  # 1    part of the swing at each end with vertical motion only, while the load changes
FREEZE = 0.75  # 1    part of the swing after which the landing point stays fixed to the ground
SAME_DISTANCE = 1e-6  # m    distances that differ by less are equal
HOME_TOLERANCE = 1e-9  # m    a foot this close to its stance position need not step any more
CLOCK_EPSILON = 1e-9  # cycles    the clock starts this much before the first lift-off
NEARLY_DONE = 1e-12  # 1    floor of 1 - s
SMALL_ANGLE = 1e-12  # rad    below it sin(a)/a is 1


# ---------------------------------------------------------------------------------------- command


@dataclass(frozen=True)
class BodyCommand:
    """Desired velocity of the torso, in its own frame, and posture."""

    vx: float = 0.0  # m/s    forward
    vy: float = 0.0  # m/s    to the left
    yaw_rate: float = 0.0  # rad/s    to the left
    height: float = 0.0  # m    above the stance
    roll: float = 0.0  # rad    z-y-x; positive lowers the right side
    pitch: float = 0.0  # rad    positive lowers the nose


class CommandRamp(Stateful):
    """Turns steps of the command into smooth changes (C1).

    A change is a cubic from the present value and rate to the new value and rate 0.

    Attributes:
        target: the command that the ramp leads to.
        steps: periods since that command was given; the controller counts them.
    """

    STATE = ("target", "steps", "_goal", "_cubic")

    def __init__(self, duration: float, *, period: float) -> None:
        self.duration, self.period = duration, period  # s
        least = itertools.count(int(duration / period))
        self.end = next(number for number in least if number * period >= duration)  # periods
        self.reset()

    def reset(self) -> None:
        """Sets the command to zero, at rest."""
        self.target, self._goal = BodyCommand(), np.zeros(6)
        self._cubic = np.zeros((4, 6))
        self.steps = self.end

    def settled(self) -> bool:
        """Returns whether the ramp has reached its target."""
        return self.steps >= self.end

    def moves(self) -> bool:
        """Returns whether the body is commanded to move, and not only to change its posture."""
        target = self.target
        return (target.vx, target.vy, target.yaw_rate) != (0.0, 0.0, 0.0)

    def _bend(self, value: Array, rate: Array) -> None:
        """Sets the cubic from a value and rate (6,) to the goal at rest (C1)."""
        gap, slope = self._goal - value, rate * self.duration
        self._cubic = np.array([value, slope, 3.0 * gap - 2.0 * slope, slope - 2.0 * gap])

    def aim(self, target: BodyCommand) -> bool:
        """Starts a ramp to a command. Returns whether the command is a new one.

        Raises HexapodError for a number that is not finite.
        """
        if target == self.target:
            return False
        goal = np.array(astuple(target), dtype=np.float64)
        if not np.isfinite(goal).all():
            raise HexapodError(
                "impossible body command",
                got=target,
                expected="finite numbers",
                fix="check where the command comes from",
            )
        value, rate = self.ahead(0)
        self.target, self._goal, self.steps = target, goal, 0
        self._bend(value, rate)
        return True

    def carry(self, before: CommandRamp) -> None:
        """Continues the change of another ramp, from its present value and rate, in its own time.

        before: a ramp of the same period whose present step is that of this one.
        """
        target, (value, rate) = before.target, before.ahead(0)
        self.target, self._goal = target, before._goal
        self.steps = self.end if before.settled() else 0
        self._bend(value, rate)

    def ahead(self, steps: int) -> tuple[Array, Array]:
        """Returns the command `steps` periods ahead, and its rate per second.

        Each is (6,): vx vy yaw_rate height roll pitch.
        """
        number = self.steps + steps
        if number >= self.end:
            return self._goal, np.zeros(6)
        x = number * self.period / self.duration
        c0, c1, c2, c3 = self._cubic
        value = c0 + x * (c1 + x * (c2 + x * c3))
        rate = (c1 + x * (2.0 * c2 + 3.0 * x * c3)) / self.duration
        return value, rate


# ------------------------------------------------------------------------------- shapes of a swing


class Twist(NamedTuple):
    """Motion of the body at one step: the command with the addition of the path loop."""

    velocity: complex  # m/s    vx + i vy
    yaw_rate: float  # rad/s


def blend(tau: Array) -> tuple[Array, Array]:
    """Returns the horizontal progress s in [0, 1] at the parts tau of a swing, and ds/dtau (C6)."""
    y = np.minimum(np.maximum((2.0 * tau - 1.0) / (1.0 - 2.0 * DWELL), -1.0), 1.0)
    y4 = y * y * y * y
    flat = 1.0 - y4
    s = 0.5 + y * (45.0 + y4 * (5.0 * y4 - 18.0)) / 64.0
    return s, 45.0 / 32.0 * flat * flat / (1.0 - 2.0 * DWELL)


def hop(tau: Array, *, top: float, down: float) -> tuple[Array, Array]:
    """Returns the lift z of the foot at the parts tau of a swing, and dz/dtau [m] (C7).

    top: the step height; down: the touch-down speed times the duration of the swing [m].
    """
    arch = tau * (1.0 - tau)
    bow, fall = 64.0 * top * arch * arch, down * tau * tau
    climb = 3.0 * bow * (1.0 - 2.0 * tau) + fall * (3.0 - 4.0 * tau)
    return (bow + fall) * arch, climb


def travel(twist: Twist, time: Array | float) -> Plane:
    """Returns the displacement [m] after a time [s] of constant twist (C3)."""
    if twist.yaw_rate == 0.0:
        return np.asarray(twist.velocity * time)
    half = 0.5 * twist.yaw_rate * time
    arc = np.maximum(np.abs(half), SMALL_ANGLE)
    return np.asarray(twist.velocity * time * (np.sin(arc) / arc) * cis(half))


# -------------------------------------------------------------------------------- paths of the feet


class PlannedFeet(NamedTuple):
    """Planned feet at one step, (6,) each unless stated otherwise.

    They are in the walking frame, except `goal`, `pull`, `way` and `turn`: ground frame.
    """

    plane: Plane  # m    centres, x + i y
    height: Array  # m    z
    velocity: Plane  # m/s    of x + i y
    rise: Array  # m/s    of z
    phase: Array  # 1    in [0, 1)
    blend: Array  # 1    s of swinging feet, else 0
    goal: Plane  # m    landing point of a swinging foot, position of a standing one
    pull: Plane  # m    q of C5, (goal - foot)/(1 - s), of swinging feet; 0 of standing ones
    rolled: Array  # m    outwards from the stance to the position that the foot aims at (C53)
    way: complex  # m    scalar: position of the walking frame, D of C3
    turn: float  # rad    scalar: heading of the walking frame, theta of C3
    twist: Twist  # of the body


class FootPaths(Stateful):
    """Paths of the feet within a section of the walk.

    A section lasts from one lift-off or touch-down to the next; the same legs are in the air
    throughout.

    Attributes, (6,) each unless stated otherwise:
        walking: the gait clock runs (scalar).
        before: periods from the begin of the walk to the first step of the section (scalar).
        swinging: legs in the air.
        standing: legs that stand by the gait clock. A leg that skips its step stands although the
            clock says that it swings: it is neither in `standing` nor in `swinging`.
        lifted: legs that lift off at the begin of the section.
        stayed: legs that skipped their last step.
        stays: legs that will skip their next step: in their stance under a body at rest.
        met: feet that have met the ground on their way down, and stay where they are.
        held: the gait clock stands still until feet at the ends of their swings carry load
            (scalar).
        awaited: feet that it waits for.
        ending: another gait follows: legs finish their steps and begin no other (scalar).
        offset: phases at the begin of the walk [cycles].
        late: legs that stand at the begin of the walk although the clock says that they swing, or
            that they take up their loads.
        narrowing: part of the way to the narrow stance that the steps aim at (scalar).
    """

    STATE = (
        "walking", "before", "swinging", "standing", "lifted", "stayed", "stays", "met", "held",
        "awaited", "ending", "offset", "late", "narrowing",
    )  # fmt: skip

    def __init__(
        self,
        gait: Gait,
        home: Array,
        *,
        period: float,
        inward: Plane | None = None,
        turned: Array | None = None,
    ) -> None:
        """Puts all feet in the stance.

        Args:
            gait: of the robot.
            home: (6, 3) centres of the feet in the stance, torso frame [m].
            period: of the controller [s].
            inward: (6,) from the stance to the narrow stance, torso frame [m]; by default 0.
            turned: (6,) distances that the feet roll outwards on this way [m]; by default 0.
        """
        self.gait, self.period = gait, period
        self.swing_time = gait.period * (1.0 - gait.duty)
        # from the lift-off to the middle of the next stance
        self.landing_lead = 0.5 * gait.period * gait.duty + self.swing_time
        self.handover = 0.0  # cycles    in which a leg takes up or gives up its load (C18)
        self.offset: Array
        self.late: Mask
        self._start_at(np.array(gait.offsets) + gait.start_clock())
        self.home, self.home_height = home[:, 0] + 1j * home[:, 1], home[:, 2].copy()
        self.inward = np.zeros(LEGS, dtype=np.complex128) if inward is None else inward
        self.turned = np.zeros(LEGS) if turned is None else turned
        self.walking, self.before = False, 0
        self.swinging: Mask
        self.standing: Mask
        self.lifted: Mask
        self.stayed: Mask
        self.stays: Mask
        self.met: Mask
        self.held = False
        self.awaited: Mask
        self.ending = False
        self.narrowing = 0.0
        self.reset()

    def _start_at(self, begin: Array) -> None:
        """Sets the phases (6,) at the begin of the walk [cycles]."""
        first = begin + CLOCK_EPSILON
        self.offset = begin - CLOCK_EPSILON
        # the walk begins in the time of their swing, or while they take up their loads
        phase = first - np.floor(first)
        self.late = (phase >= self.gait.duty) | (phase < 0.5 * self.handover)

    def _phase_after(self, number: int) -> Array:
        """Returns the phases (6,) `number` periods after the begin of the walk (C2)."""
        clock = self.offset + number * self.period / self.gait.period
        return np.asarray(clock - np.floor(clock))

    def _reached(self, number: int) -> int:
        """Returns the periods on the gait clock `number` periods after the section began (C50)."""
        return self.before if self.held else self.before + number

    def _rest(self, plane: Plane) -> PlannedFeet:
        """Stops the gait clock at its begin; returns feet that stand still at `plane`."""
        nothing, none = np.zeros(LEGS), np.zeros(LEGS, dtype=np.bool_)
        still = np.zeros(LEGS, dtype=np.complex128)
        self.walking, self.before = False, 0
        self.swinging = self.standing = self.lifted = self.stays = none
        self.met = self.awaited = none
        self.held = self.ending = False
        self.stayed = self.late
        return PlannedFeet(
            plane=plane,
            height=self.home_height,
            velocity=still,
            rise=nothing,
            phase=self._phase_after(0),
            blend=nothing,
            goal=plane,
            pull=still,
            rolled=self.narrowing * self.turned,
            way=0j,
            turn=0.0,
            twist=Twist(0j, 0.0),
        )

    def reset(self) -> PlannedFeet:
        """Puts all feet in the stance and stops the gait clock; returns the feet."""
        self.narrowing = 0.0
        return self._rest(self.home)

    def _lift_off(self) -> None:
        """Sets the legs that stand and lift off in the coming section by the gait clock."""
        stood = self._phase_after(self.before) < self.gait.duty
        self.standing = self._phase_after(self.before + 1) < self.gait.duty
        self.lifted = stood & ~self.standing
        self.stayed = self.stayed | self.lifted
        self.swinging = self.swinging & ~self.standing
        self.stays = np.zeros(LEGS, dtype=np.bool_)

    def _aims(self) -> Plane:
        """Returns the stance positions (6,) that the steps aim at, walking frame [m] (C53)."""
        return np.asarray(self.home + self.narrowing * self.inward)

    def _come_home(self, swung: Mask, now: PlannedFeet) -> tuple[bool, Plane]:
        """Lets feet that are in their stance positions skip their steps.

        swung: (6,) legs that were in the air until now. Returns whether all feet stand in their
        stance positions, and the positions of the feet (6,) [m]; a foot that has just landed is at
        its goal.
        """
        landed = swung & self.standing
        feet = np.where(landed, cis(-now.turn) * (now.goal - now.way), now.plane)
        home = np.abs(feet - self._aims()) < HOME_TOLERANCE
        self.lifted = self.lifted & ~home
        self.stays = home & ~self.swinging
        return bool(home.all() and not (self.swinging | self.lifted).any()), feet

    def _keep_down(self, kept: Mask) -> None:
        """Lets the legs skip their next steps that have not begun to give up their loads (C55).

        kept: (6,) legs that were to skip them already.
        """
        phase, unloads = self._phase_after(self.before), self.gait.duty - 0.5 * self.handover
        leaving = (phase >= unloads) & (phase < self.gait.duty) & ~kept
        self.stays = ~self.swinging & ~leaving
        self.lifted = self.lifted & ~self.stays

    def _progress(self, phase: Array) -> Array:
        """Returns the completed parts tau of the swings (6,) at these phases (C2)."""
        return (phase - self.gait.duty) / (1.0 - self.gait.duty)

    def _ground_of(self, feet: PlannedFeet) -> Plane:
        """Returns the feet (6,) in the ground frame [m] (C5)."""
        return feet.goal - feet.pull * (1.0 - feet.blend)

    def _place_feet(self, feet: PlannedFeet, carried: Plane) -> PlannedFeet:
        """Computes positions and velocities of feet with known phases, goals and pulls (C5 to C8).

        carried: (6,) feet at the step before, ground frame [m].
        """
        back, tau = cis(-feet.turn), self._progress(feet.phase)
        s, slope = blend(tau)
        feet = feet._replace(blend=np.where(self.swinging, s, 0.0))
        lift, climb = hop(
            tau,
            top=self.gait.step_height,
            down=self.gait.touchdown_speed * self.swing_time,
        )
        was = back * (carried - feet.way)
        # 1/s    at which the feet pass through their paths
        pace = 0.0 if self.held else 1.0 / self.swing_time
        pulled = back * feet.pull * (slope * pace)
        # a foot on the ground: dp/dt = -(v + i w p)
        velocity = pulled - (feet.twist.velocity + 1j * feet.twist.yaw_rate * was)
        return feet._replace(
            plane=back * (self._ground_of(feet) - feet.way),
            height=self.home_height + np.where(self.swinging, lift, 0.0),
            velocity=velocity,
            rise=np.where(self.swinging, climb * pace, 0.0),
        )

    def _set_out(self, now: PlannedFeet, twist: Twist) -> PlannedFeet:
        """Computes the present step again, with the legs that swing in the new section."""
        phase = self._phase_after(self.before)
        s = np.where(self.swinging, blend(self._progress(phase))[0], 0.0)
        pull = np.where(self.swinging, now.pull, 0.0)
        feet = now._replace(phase=phase, blend=s, pull=pull, twist=twist)
        return self._place_feet(feet, self._ground_of(feet))

    def plan(self, now: PlannedFeet, number: int, *, going: bool, twist: Twist) -> PlannedFeet:
        """Begins a new section after the present step.

        Args:
            now: the feet at the present step.
            number: periods since the last section began.
            going: the body moves or is commanded to; otherwise feet step home and the gait clock
                then stops.
            twist: the motion of the body now.

        Returns:
            The feet at the present step, from which the section starts.
        """
        if not self.walking and not going:
            return self._rest(now.plane)
        self.before = self._reached(number) if self.walking else 0
        self.held, self.awaited = False, np.zeros(LEGS, dtype=np.bool_)
        swung, kept = self.swinging, self.stays
        self._lift_off()
        if self.ending:
            self._keep_down(kept)
        elif not going:
            done, feet = self._come_home(swung, now)
            if done:
                return self._rest(feet)
        self.swinging = self.swinging | self.lifted
        self.stayed = self.stayed & ~self.lifted
        self.walking = True
        return self._set_out(now, twist)

    def ended(self) -> bool:
        """Returns whether all legs stand and begin no other step, because another gait follows."""
        return self.ending and not self.held and bool(self.stays.all())

    def _farthest(self, feet: PlannedFeet, begin: Array) -> float:
        """Returns how far a foot will be from its stance position at its lift-off [m] (C55).

        It is that of the farthest foot. feet: that stand; begin: (6,) phases at the begin of the
        walk [cycles].
        """
        left = self.gait.duty - begin + CLOCK_EPSILON
        time = (left - np.floor(left)) * self.gait.period
        motion = feet.twist.velocity + 1j * feet.twist.yaw_rate * feet.plane
        return float(np.abs(feet.plane - motion * time - self._aims()).max())

    def join(self, feet: PlannedFeet) -> PlannedFeet:
        """Begins the walk anew with feet that stand under a moving body (C55).

        One leg begins to give up its load: the first of those with which the farthest foot goes
        least far.
        """
        if not self.walking:
            return self._rest(feet.plane)
        least = np.inf
        unloads, offset = self.gait.duty - 0.5 * self.handover, np.array(self.gait.offsets)
        for first in range(LEGS):
            begin = unloads + (offset - offset[first])
            far = self._farthest(feet, begin)
            if far < least - SAME_DISTANCE:
                least = far
                self._start_at(begin)
        none = np.zeros(LEGS, dtype=np.bool_)
        self.before, self.held, self.ending = 0, False, False
        self.swinging = self.lifted = self.stays = self.met = self.awaited = none
        self.standing, self.stayed = self._phase_after(0) < self.gait.duty, self.late
        return feet

    def carry(self) -> None:
        """Goes on in the present phases under another control, in the same gait."""
        self.met = np.zeros(LEGS, dtype=np.bool_)

    def landing(self, number: int) -> Mask:
        """Returns the legs (6,) whose swing ends at the present step.

        While the gait clock stands still, these are the legs whose swing ended when it stopped.

        number: periods since the section began.
        """
        if not self.walking:
            return np.zeros(LEGS, dtype=np.bool_)
        stands = self._phase_after(self._reached(number) + 1) < self.gait.duty
        return np.asarray(self.swinging & stands)

    def hold(self, now: PlannedFeet, number: int, *, twist: Twist) -> PlannedFeet:
        """Begins a section in which the gait clock stands still while the body moves on (C50).

        Arguments and result are those of plan().
        """
        self.awaited = self.landing(number)
        self.before = self._reached(number)
        self.held, self.lifted = True, np.zeros(LEGS, dtype=np.bool_)
        return self._set_out(now, twist)

    def reach(self, number: int) -> bool:
        """Returns whether the step `number` periods after the first belongs to the section.

        It does if no leg lifts off or touches down before it.
        """
        if not self.walking or self.held or number == 1:
            return True
        stands = self._phase_after(self.before + number) < self.gait.duty
        return bool((stands == self.standing).all())

    def _landing(self, tau: Array, twist: Twist) -> Plane:
        """Returns the landing points (6,) in the walking frame [m] (C4, C53)."""
        ahead = self.landing_lead - tau * self.swing_time
        return np.asarray(cis(twist.yaw_rate * ahead) * self._aims() + travel(twist, ahead))

    def _odometry(self, before: PlannedFeet, twist: Twist) -> tuple[complex, float]:
        """Returns position [m] and heading [rad] of the walking frame in the ground frame (C3)."""
        last = before.twist
        mean = Twist(
            0.5 * (twist.velocity + last.velocity),
            0.5 * (twist.yaw_rate + last.yaw_rate),
        )
        way = before.way + cis(before.turn) * travel(mean, self.period)
        return complex(way), before.turn + mean.yaw_rate * self.period

    def walk(self, number: int, twist: Twist, before: PlannedFeet) -> PlannedFeet:
        """Returns the feet `number` periods after the first step of the section.

        before: the step before it.
        """
        if not self.walking:
            return before
        way, turn = self._odometry(before, twist)
        phase = self._phase_after(self._reached(number))
        tau = self._progress(phase)
        free = self.swinging & (tau < FREEZE)
        if number == 1:
            free = free | (self.swinging & self.lifted)  # every foot is aimed once
        goal = np.where(free, way + cis(turn) * self._landing(tau, twist), before.goal)
        left = np.maximum(1.0 - before.blend, NEARLY_DONE)
        pull = before.pull + (goal - before.goal) / left
        aim = self.narrowing * self.turned
        rolls = aim - (aim - before.rolled) * (1.0 - blend(tau)[0]) / left
        rolled = np.where(self.swinging & ~self.met, rolls, before.rolled)
        # a foot stays where it met the ground (C51)
        goal = np.where(self.met, self._ground_of(before), goal)
        pull = np.where(self.met, 0.0, pull)
        feet = before._replace(
            phase=phase, goal=goal, pull=pull, rolled=rolled, way=way, turn=turn, twist=twist
        )
        return self._place_feet(feet, self._ground_of(before))
