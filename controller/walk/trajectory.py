"""Where the feet should be: from the body command to the paths of the feet. C: trajectory.c.

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
HOME_TOLERANCE = 1e-9  # m    a foot this close to its stance position need not step any more
CLOCK_EPSILON = 1e-9  # cycles    the clock starts this much before the first lift-off
NEARLY_DONE = 1e-12  # 1    floor of 1 - s
SMALL_ANGLE = 1e-12  # rad    below it sin(a)/a is 1


# ---------------------------------------------------------------------------------------- command


@dataclass(frozen=True)
class BodyCommand:
    """What the torso should do, in its own frame."""

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
        steps: periods since that command was given; the owner counts them.
    """

    STATE = ("target", "steps", "_goal", "_cubic")

    def __init__(self, duration: float, *, period: float) -> None:
        self.duration, self.period = duration, period  # s
        least = itertools.count(int(duration / period))
        self.end = next(number for number in least if number * period >= duration)  # periods
        self.reset()

    def reset(self) -> None:
        """The zero command, at rest."""
        self.target, self._goal = BodyCommand(), np.zeros(6)
        self._cubic = np.zeros((4, 6))
        self.steps = self.end

    def settled(self) -> bool:
        """Whether the value is the target, and at rest."""
        return self.steps >= self.end

    def moves(self) -> bool:
        """Whether the body is commanded to move, and not only to change its posture."""
        target = self.target
        return (target.vx, target.vy, target.yaw_rate) != (0.0, 0.0, 0.0)

    def aim(self, target: BodyCommand) -> bool:
        """Heads for a command. Returns whether it is a new one.

        Raises HexapodError when a number of it is not finite.
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
        gap, slope = goal - value, rate * self.duration
        self._cubic = np.array([value, slope, 3.0 * gap - 2.0 * slope, slope - 2.0 * gap])
        self.target, self._goal, self.steps = target, goal, 0
        return True

    def ahead(self, steps: int) -> tuple[Array, Array]:
        """The command so many periods ahead, (6,) vx vy yaw_rate height roll pitch, and its rate.

        The rate is per second.
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
    """The motion of the body at one step: of the command and of what leads it back to its way."""

    velocity: complex  # m/s    vx + i vy
    yaw_rate: float  # rad/s


def blend(tau: Array) -> tuple[Array, Array]:
    """The horizontal progress s in [0, 1] at the parts tau of a swing, and ds/dtau (C6)."""
    y = np.minimum(np.maximum((2.0 * tau - 1.0) / (1.0 - 2.0 * DWELL), -1.0), 1.0)
    y4 = y * y * y * y
    flat = 1.0 - y4
    s = 0.5 + y * (45.0 + y4 * (5.0 * y4 - 18.0)) / 64.0
    return s, 45.0 / 32.0 * flat * flat / (1.0 - 2.0 * DWELL)


def hop(tau: Array, *, top: float, down: float) -> tuple[Array, Array]:
    """The lift z of the foot at the parts tau of a swing, and dz/dtau [m] (C7).

    top: the step height; down: the touch-down speed times the duration of the swing [m].
    """
    arch = tau * (1.0 - tau)
    bow, fall = 64.0 * top * arch * arch, down * tau * tau
    climb = 3.0 * bow * (1.0 - 2.0 * tau) + fall * (3.0 - 4.0 * tau)
    return (bow + fall) * arch, climb


def travel(twist: Twist, time: Array | float) -> Plane:
    """The way [m] under a constant twist for a time [s]: v (e^(i w t) - 1)/(i w) (C3)."""
    if twist.yaw_rate == 0.0:
        return np.asarray(twist.velocity * time)
    half = 0.5 * twist.yaw_rate * time
    arc = np.maximum(np.abs(half), SMALL_ANGLE)
    return np.asarray(twist.velocity * time * (np.sin(arc) / arc) * cis(half))


# -------------------------------------------------------------------------------- paths of the feet


class PlannedFeet(NamedTuple):
    """The feet at one step, (6,) each unless said otherwise, as the command plans them.

    Walking frame, but `goal`, `pull`, `way` and `turn`: ground frame.
    """

    plane: Plane  # m    centres, x + i y
    height: Array  # m    z
    velocity: Plane  # m/s    of x + i y
    rise: Array  # m/s    of z
    phase: Array  # 1    in [0, 1)
    blend: Array  # 1    s of swinging feet, else 0
    goal: Plane  # m    where a swinging foot will touch down, where a standing one stands
    pull: Plane  # m    (goal - foot)/(1 - s) of swinging feet, 0 of standing ones
    way: complex  # m    scalar: of the walking frame over the ground
    turn: float  # rad    scalar: of the walking frame over the ground
    twist: Twist  # of the body


class FootPaths(Stateful):
    """The paths of the feet, between a lift-off or touch-down and the next.

    The same legs are in the air throughout such a section of the walk.

    Attributes, (6,) each unless said otherwise:
        walking: the gait clock runs (scalar).
        before: periods from the begin of the walk to the first step of the section (scalar).
        swinging: legs in the air.
        standing: legs on the ground by the clock; one with nowhere to step neither stands by it nor
            swings.
        lifted: legs that lift off at the begin of the section.
        stayed: legs that had nowhere to step at their last lift-off and stood through their swing.
        stays: legs that will have nowhere to step at their next one: home under a body at rest.
    """

    STATE = ("walking", "before", "swinging", "standing", "lifted", "stayed", "stays")

    def __init__(self, gait: Gait, home: Array, *, period: float) -> None:
        """home: (6, 3) centres of the feet in the stance, torso frame [m]; period [s]."""
        self.gait, self.period = gait, period
        self.swing_time = gait.period * (1.0 - gait.duty)
        # from the lift-off to the middle of the next stance
        self.landing_lead = 0.5 * gait.period * gait.duty + self.swing_time
        begin = np.array(gait.offsets) + gait.start_clock()
        first = begin + CLOCK_EPSILON
        self.offset = begin - CLOCK_EPSILON  # cycles    phases at the begin of the walk
        # the walk begins in the time of their swing
        self.late = first - np.floor(first) >= gait.duty
        self.home, self.home_height = home[:, 0] + 1j * home[:, 1], home[:, 2].copy()
        self.walking, self.before = False, 0
        self.swinging: Mask
        self.standing: Mask
        self.lifted: Mask
        self.stayed: Mask
        self.stays: Mask
        self.reset()

    def _phase_after(self, number: int) -> Array:
        """(6,) the phases so many periods after the begin of the walk (C2)."""
        clock = self.offset + number * self.period / self.gait.period
        return np.asarray(clock - np.floor(clock))

    def _rest(self, plane: Plane) -> PlannedFeet:
        """Standing still with the feet at `plane`, the gait clock rewound."""
        nothing, none = np.zeros(LEGS), np.zeros(LEGS, dtype=np.bool_)
        still = np.zeros(LEGS, dtype=np.complex128)
        self.walking, self.before = False, 0
        self.swinging = self.standing = self.lifted = self.stays = none
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
            way=0j,
            turn=0.0,
            twist=Twist(0j, 0.0),
        )

    def reset(self) -> PlannedFeet:
        """All feet in the stance, the gait clock stopped."""
        return self._rest(self.home)

    def _lift_off(self) -> None:
        """Which legs are in the air in the coming section, by the gait clock."""
        stood = self._phase_after(self.before) < self.gait.duty
        self.standing = self._phase_after(self.before + 1) < self.gait.duty
        self.lifted = stood & ~self.standing
        self.stayed = self.stayed | self.lifted
        self.swinging = self.swinging & ~self.standing
        self.stays = np.zeros(LEGS, dtype=np.bool_)

    def _come_home(self, swung: Mask, now: PlannedFeet) -> tuple[bool, Plane]:
        """Keeps the feet that are home there.

        swung: (6,) legs that were in the air until now. Returns whether all feet are home and on
        the ground, and where the feet are (6,) [m], those that have just landed at their goals.
        """
        landed = swung & self.standing
        feet = np.where(landed, cis(-now.turn) * (now.goal - now.way), now.plane)
        home = np.abs(feet - self.home) < HOME_TOLERANCE
        self.lifted = self.lifted & ~home
        self.stays = home & ~self.swinging
        return bool(home.all() and not (self.swinging | self.lifted).any()), feet

    def _progress(self, phase: Array) -> Array:
        """(6,) the parts tau of their swings that legs at these phases have done."""
        return (phase - self.gait.duty) / (1.0 - self.gait.duty)

    def _ground_of(self, feet: PlannedFeet) -> Plane:
        """(6,) where the feet are on the ground (C5) [m]."""
        return feet.goal - feet.pull * (1.0 - feet.blend)

    def _place_feet(self, feet: PlannedFeet, carried: Plane) -> PlannedFeet:
        """Places and velocities of feet whose phases, goals, pulls and frame are known (C5 to C8).

        carried: (6,) where the feet were on the ground at the step before [m].
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
        pulled = back * feet.pull * (slope / self.swing_time)
        # a foot on the ground: dp/dt = -(v + i w p)
        velocity = pulled - (feet.twist.velocity + 1j * feet.twist.yaw_rate * was)
        return feet._replace(
            plane=back * (self._ground_of(feet) - feet.way),
            height=self.home_height + np.where(self.swinging, lift, 0.0),
            velocity=velocity,
            rise=np.where(self.swinging, climb / self.swing_time, 0.0),
        )

    def _set_out(self, now: PlannedFeet, twist: Twist) -> PlannedFeet:
        """The present step once more, with the legs in the air that will be in the section."""
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
            The feet at the present step, from which the section sets out.
        """
        if not self.walking and not going:
            return self._rest(now.plane)
        self.before = self.before + number if self.walking else 0
        swung = self.swinging
        self._lift_off()
        if not going:
            done, feet = self._come_home(swung, now)
            if done:
                return self._rest(feet)
        self.swinging = self.swinging | self.lifted
        self.stayed = self.stayed & ~self.lifted
        self.walking = True
        return self._set_out(now, twist)

    def reach(self, number: int) -> bool:
        """Whether the step so many periods after the first still belongs to the section.

        It does as long as no leg lifts off or touches down before it.
        """
        if not self.walking or number == 1:
            return True
        stands = self._phase_after(self.before + number) < self.gait.duty
        return bool((stands == self.standing).all())

    def _landing(self, tau: Array, twist: Twist) -> Plane:
        """The landing points (C4), (6,) ground frame relative to the present place [m]."""
        ahead = self.landing_lead - tau * self.swing_time
        return np.asarray(cis(twist.yaw_rate * ahead) * self.home + travel(twist, ahead))

    def _odometry(self, before: PlannedFeet, twist: Twist) -> tuple[complex, float]:
        """Way [m] and turn [rad] of the walking frame since the begin of the walk (C3)."""
        last = before.twist
        mean = Twist(
            0.5 * (twist.velocity + last.velocity),
            0.5 * (twist.yaw_rate + last.yaw_rate),
        )
        way = before.way + cis(before.turn) * travel(mean, self.period)
        return complex(way), before.turn + mean.yaw_rate * self.period

    def walk(self, number: int, twist: Twist, before: PlannedFeet) -> PlannedFeet:
        """The feet so many periods after the first step of the section, from the step before."""
        if not self.walking:
            return before
        way, turn = self._odometry(before, twist)
        phase = self._phase_after(self.before + number)
        tau = self._progress(phase)
        free = self.swinging & (tau < FREEZE)
        if number == 1:
            free = free | (self.swinging & self.lifted)  # every foot is aimed once
        goal = np.where(free, way + cis(turn) * self._landing(tau, twist), before.goal)
        left = np.maximum(1.0 - before.blend, NEARLY_DONE)
        pull = before.pull + (goal - before.goal) / left
        feet = before._replace(phase=phase, goal=goal, pull=pull, way=way, turn=turn, twist=twist)
        return self._place_feet(feet, self._ground_of(before))
