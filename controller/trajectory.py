"""Where the feet should be: from a body command to foot paths in the walking frame.

The walking frame is the torso frame of a robot at its nominal height and level posture. Its
horizontal points are complex numbers p = x + i y: it moves over the ground with the velocity v = vx
+ i vy and the yaw rate w, so a foot that stands moves by -(v + i w p). A swinging foot moves from
the ground point it left to the ground point where it will be half-way through the next stance under
its stance position. Both are fixed to the ground, so with a blend s(tau) whose ends have neither
speed nor acceleration the foot leaves and meets the ground without sliding:

    ds/dx = 45/32 (1 - y^4)^2,  y = 2 x - 1,  x = (tau - DWELL) / (1 - 2 DWELL)        z = 64 H (tau
    (1 - tau))^3

The blend's flat top keeps the peak speed at 1.41 times the mean; the quintic of least jerk needs
1.88 and a cycloid 2, which the joints of small servos do not reach. DWELL keeps the foot from
moving sideways while it is still unloading, or already loading.
"""

from __future__ import annotations

import itertools
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from hexapod_cosim.controller.gait import Gait
from hexapod_cosim.controller.kinematics import LEGS, Array, Mask, Plane
from hexapod_cosim.models import HexapodError

DWELL = 0.1  # 1    share of the swing at each end with vertical motion only
FREEZE = 0.75  # 1    part of the swing after which the landing point stays fixed to the ground
HOME_TOLERANCE = 1e-9  # m    a foot this close to its stance position need not step any more
CLOCK_EPSILON = 1e-9  # cycles    the clock starts this much before the first lift-off
NEARLY_DONE = 1e-12  # 1    floor of 1 - s
SMALL_ANGLE = 1e-12  # rad    below it sin(a)/a is 1


@dataclass(frozen=True)
class BodyCommand:
    """What the torso should do, in its own frame."""

    vx: float = 0.0  # m/s    forward
    vy: float = 0.0  # m/s    to the left
    yaw_rate: float = 0.0  # rad/s    to the left
    height: float = 0.0  # m    above the stance
    roll: float = 0.0  # rad    z-y-x; positive lowers the right side
    pitch: float = 0.0  # rad    positive lowers the nose


class CommandRamp:
    """Turns steps of the command into smooth changes: a cubic from the present value and rate to
    the new value and rate 0.

    Attributes: target: where it goes; steps: periods since that was told, which the owner counts
    on.
    """

    def __init__(self, duration: float, *, period: float) -> None:
        self.duration, self.period = duration, period  # s
        self._cubic = np.zeros((4, 6))
        self._end = next(
            number
            for number in itertools.count(int(duration / period))
            if number * period >= duration
        )  # steps that a change takes
        self.reset()

    def reset(self) -> None:
        """Back to the zero command, at rest."""
        self._cubic[:] = 0.0
        self.target, self._goal = BodyCommand(), np.zeros(6)
        self.steps = self._end

    def save(self) -> tuple[Any, ...]:
        """Returns the state that restore() takes."""
        return self.target, self._goal, self.steps, self._cubic.copy()

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restores a state returned by save()."""
        self.target, self._goal, self.steps, self._cubic[:] = state

    @property
    def settled(self) -> bool:
        """The value is the target, and at rest."""
        return self.steps >= self._end

    @property
    def remaining(self) -> int:
        """Steps until it is."""
        return max(self._end - self.steps, 0)

    def aim(self, target: BodyCommand) -> None:
        """Heads for a command; repeating the present one changes nothing. Raises HexapodError
        when it is not finite.
        """
        if target == self.target:
            return
        goal = np.array(astuple(target), dtype=np.float64)
        if not np.isfinite(goal).all():
            raise HexapodError(
                "impossible body command",
                got=target,
                expected="finite numbers",
                fix="check where the command comes from",
            )
        (value,), (rate,) = self.ahead(0)
        gap, slope = goal - value, rate * self.duration
        self._cubic[:] = value, slope, 3.0 * gap - 2.0 * slope, slope - 2.0 * gap
        self.target, self._goal, self.steps = target, goal, 0

    def ahead(self, count: int) -> tuple[Array, Array]:
        """(count + 1, 6) each: vx vy yaw_rate height roll pitch now and at the next `count`
        steps, and their rates per second.
        """
        if self.settled:
            return np.tile(self._goal, (count + 1, 1)), np.zeros((count + 1, 6))
        numbers = np.arange(self.steps, self.steps + count + 1)[:, None]
        x, under_way = numbers * self.period / self.duration, numbers < self._end
        c0, c1, c2, c3 = self._cubic
        value = np.where(under_way, c0 + x * (c1 + x * (c2 + x * c3)), self._goal)
        rate = np.where(under_way, (c1 + x * (2.0 * c2 + 3.0 * x * c3)) / self.duration, 0.0)
        return value, rate


@dataclass(frozen=True)
class Steps:
    """Feet at successive periods, (n, 6) each, in the walking frame; what is on the ground in
    its frame, where the walk began.
    """

    plane: Plane  # m    centres, x + i y
    height: Array  # m    and z
    plane_velocity: Plane  # m/s
    rise: Array  # m/s
    phase: Array  # 1    in [0, 1)
    swinging: Mask
    progress: Array  # 1    tau of swinging feet, else 0
    blend: Array  # 1    s of swinging feet, else 0
    goal: Plane  # m    on the ground: where a swinging foot will touch down, a standing one stands
    pull: Plane  # m    (goal - foot)/(1 - s) on the ground, 0 of standing feet
    way: Plane  # m    (n, 1) of the walking frame over the ground
    turn: Array  # rad    (n, 1)
    # had nowhere to step when they were to lift off last, so they stood through the time of their
    # swing
    stayed: Mask
    stays: Mask  # will have nowhere to when they are next: at home under a body at rest


class FootPaths:
    """The planned feet. Steps depend on the command alone, so many are planned at once and then
    taken one by one.

    Nothing in a step depends on how many are planned at once: sums over time run from the walk's
    begin.

    Attributes: steps: planned, of which number `at` is the present one and `left` are to come;
    walking: the gait clock runs.
    """

    def __init__(self, gait: Gait, home: Array, *, period: float) -> None:
        self.gait, self.period = gait, period
        self.home, self.home_height = home[:, 0] + 1j * home[:, 1], home[:, 2].copy()
        self.swing_time = gait.period * (1.0 - gait.duty)
        self._landing_lead = (
            0.5 * gait.period * gait.duty + self.swing_time
        )  # s    from lift-off to the middle of the next stance
        begin = np.array(gait.offsets) + gait.start_clock()
        self._offsets, self._never = begin - CLOCK_EPSILON, np.zeros(LEGS, dtype=np.bool_)
        self._late = (
            begin + CLOCK_EPSILON
        ) % 1.0 >= gait.duty  # the walk begins in the time of their swing
        self.steps: Steps
        self.at, self.walking, self._before = 0, False, 0
        self.reset()

    def reset(self) -> None:
        """All feet in the stance, clock stopped."""
        self._rest(self.home, 0)

    def save(self) -> tuple[Any, ...]:
        """What it remembers, and what is planned."""
        return self.steps, self.at, self.walking, self._before

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restores a state returned by save()."""
        self.steps, self.at, self.walking, self._before = state

    @property
    def left(self) -> int:
        """Planned steps to come."""
        return len(self.steps.phase) - 1 - self.at

    def advance(self) -> None:
        """One period on, to a step that is planned."""
        self.at += 1

    def _rest(self, plane: Plane, count: int) -> None:
        """Plans `count` more steps of standing still, with the clock rewound."""
        zeros, still = np.zeros((count + 1, LEGS)), np.zeros((count + 1, LEGS), dtype=np.complex128)
        plane, height, phase = (
            np.tile(row, (count + 1, 1))
            for row in (plane, self.home_height, self._phases(np.zeros(1))[0])
        )
        self.walking, self.at, self._before = False, 0, 0
        self.steps = Steps(
            plane=plane,
            height=height,
            plane_velocity=still,
            rise=zeros,
            phase=phase,
            swinging=zeros > 0.0,
            progress=zeros,
            blend=zeros,
            goal=plane,
            pull=still,
            way=still[:, :1],
            turn=zeros[:, :1],
            stayed=np.broadcast_to(self._late, zeros.shape),
            stays=zeros > 0.0,
        )

    def _phases(self, numbers: Array) -> Array:
        """(n, 6) phases so many periods after the walk's begin."""
        clock = self._offsets + (numbers * self.period / self.gait.period)[:, None]
        return np.asarray(clock - np.floor(clock))

    def plan(self, v: Plane, yaw_rate: Array, *, going: bool) -> None:
        """Plans the steps after the present one, up to the next in which a leg lifts off or touches
        down.

        Args:
            v, yaw_rate: (n + 1,) vx + i vy and yaw rate [m/s, rad/s] now and at the next n steps.
            going: the body moves or is commanded to; when False, feet step home and the clock then
                stops.
        """
        steps, at = self.steps, self.at
        before = self._before + at if self.walking else 0
        if not (self.walking or going):
            self._rest(steps.plane[at], len(v) - 1)
            return
        phase = self._phases(np.arange(before, before + len(v), dtype=np.float64))
        standing = phase < self.gait.duty
        due = standing[0] & ~standing[1]
        feet, lifted, stays = steps.plane[at], due.copy(), self._never
        swinging = steps.swinging[at] & ~standing[1]
        if not going:
            landed = steps.swinging[at] & standing[1]
            feet = np.where(landed, cis(-steps.turn[at]) * (steps.goal[at] - steps.way[at]), feet)
            home = np.abs(feet - self.home) < HOME_TOLERANCE
            lifted &= ~home
            stays = home & ~swinging
            if home.all() and not (swinging | lifted).any():
                self._rest(feet, len(v) - 1)
                return
        changed = (
            int((standing[1:] != standing[1]).argmax()) // LEGS
        )  # the first never differs from itself: 0 is none
        end = 1 + (changed or len(v) - 1)
        stayed = (steps.stayed[at] | due) & ~lifted
        self.steps = self._walk(
            v[:end, None],
            yaw_rate[:end, None],
            phase[:end],
            swinging | lifted,
            lifted,
            (stayed, stays),
        )
        self.walking, self.at, self._before = True, 0, before

    def _walk(
        self,
        v: Plane,
        yaw_rate: Array,
        phase: Array,
        swinging: Mask,
        lifted: Mask,
        stay: tuple[Mask, Mask],
    ) -> Steps:
        """The steps in which these legs (6,) are in the air; those that lift off just now will
        in any case be aimed once.
        """
        now, at, time = self.steps, self.at, self.swing_time
        tau = (phase - self.gait.duty) / (1.0 - self.gait.duty)
        way, turn = self._odometry(v, yaw_rate)
        # the way to the landing point shrinks as 1 - s: with pull = (goal - foot)/(1 - s), pull' =
        # pull + (goal' - goal)/(1 - s)
        s, slope = blend(tau)
        s = np.where(swinging, s, 0.0)
        free = swinging & (tau < FREEZE)
        free[0], free[1] = True, free[1] | lifted
        goal = _held(way + cis(turn) * self._landing(tau, v, yaw_rate), free, now.goal[at])
        pull = np.empty_like(goal)
        pull[0] = np.where(swinging, now.pull[at], 0.0)
        pull[1:] = np.diff(goal, axis=0) / np.maximum(1.0 - s[:-1], NEARLY_DONE)
        np.cumsum(pull, axis=0, out=pull)
        ground, back = goal - (1.0 - s) * pull, cis(-turn)
        plane, carried = (
            back * (ground - way),
            back * (np.concatenate([ground[:1], ground[:-1]]) - way),
        )
        # a foot on the ground: dp/dt = -(v + i w p)
        velocity = slope / time * (back * pull) - (v + 1j * yaw_rate * carried)
        lift, climb = hop(tau, top=self.gait.step_height, down=self.gait.touchdown_speed * time)
        return Steps(
            plane=plane,
            height=self.home_height + np.where(swinging, lift, 0.0),
            plane_velocity=velocity,
            rise=np.where(swinging, climb / time, 0.0),
            phase=phase,
            swinging=np.broadcast_to(swinging, phase.shape),
            progress=np.where(swinging, tau, 0.0),
            blend=s,
            goal=goal,
            pull=pull,
            way=way,
            turn=turn,
            stayed=np.broadcast_to(stay[0], phase.shape),
            stays=np.broadcast_to(stay[1], phase.shape),
        )

    def _odometry(self, v: Plane, yaw_rate: Array) -> tuple[Plane, Array]:
        """(n, 1) each: way and turn of the walking frame since the walk's begin."""
        turn, way = np.empty_like(yaw_rate), np.empty_like(v)
        turn[0], way[0] = self.steps.turn[self.at], self.steps.way[self.at]
        rate = 0.5 * (yaw_rate[1:] + yaw_rate[:-1])
        np.cumsum(np.concatenate([turn[:1], rate * self.period]), axis=0, out=turn)
        way[1:] = cis(turn[:-1]) * travel(0.5 * (v[1:] + v[:-1]), rate, self.period)
        return np.cumsum(way, axis=0), turn

    def _landing(self, tau: Array, v: Plane, yaw_rate: Array) -> Plane:
        """Where the ground under the stance position, half a stance after touch-down, is now."""
        ahead = self._landing_lead - tau * self.swing_time
        turned = cis(yaw_rate * ahead) * self.home if yaw_rate.any() else self.home
        return np.asarray(turned + travel(v, yaw_rate, ahead))


def _held(values: Plane, free: Mask, before: Plane) -> Plane:
    """The ones `before` (6,) in the first row; then the values while they are `free`, which is
    at once or never; then the last.
    """
    values[0] = before
    last = free[1:].sum(axis=0)
    return np.where(free, values, values[last, np.arange(LEGS)])


def cis(angle: Array) -> Plane:
    """e^(i angle)"""
    return np.asarray(np.cos(angle) + 1j * np.sin(angle))


def travel(v: Plane, yaw_rate: Array, time: Array | float) -> Plane:
    """The way under a constant twist: v (e^(i w t) - 1)/(i w)."""
    if not yaw_rate.any():
        return np.asarray(v * time)
    half = 0.5 * yaw_rate * time
    chord = np.divide(np.sin(half), half, out=np.ones_like(half), where=np.abs(half) > SMALL_ANGLE)
    return np.asarray(v * time * chord * cis(half))


def blend(tau: Array) -> tuple[Array, Array]:
    """s in [0, 1] and ds/dtau: s = 1/2 + 45/64 y - 9/32 y^5 + 5/64 y^9 between the dwells."""
    y = np.minimum(np.maximum((2.0 * tau - 1.0) / (1.0 - 2.0 * DWELL), -1.0), 1.0)
    y4 = y * y * y * y
    flat = 1.0 - y4
    return 0.5 + y * (45.0 + y4 * (5.0 * y4 - 18.0)) / 64.0, 45.0 / 32.0 * flat * flat / (
        1.0 - 2.0 * DWELL
    )


def hop(tau: Array, *, top: float, down: float) -> tuple[Array, Array]:
    """z and dz/dtau [m]: 64 top (tau (1 - tau))^3 + down tau^3 (1 - tau), down the touch-down
    speed times the swing's time.
    """
    arch = tau * (1.0 - tau)
    bow, fall = 64.0 * top * arch * arch, down * tau * tau
    return (bow + fall) * arch, 3.0 * bow * (1.0 - 2.0 * tau) + fall * (3.0 - 4.0 * tau)
