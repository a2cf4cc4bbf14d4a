"""Where the feet should be: from a body command to foot paths in the walking frame.

The walking frame is the torso frame of a robot at its nominal height and level posture. Its horizontal points are complex numbers
p = x + i y: it moves over the ground with the velocity v = vx + i vy and the yaw rate w, so a foot that stands moves by -(v + i w p).
A swinging foot moves from the ground point it left to the ground point where it will be half-way through the next stance under its
stance position. Both are fixed to the ground, so with a blend s(tau) whose ends have neither speed nor acceleration the foot leaves and
meets the ground without sliding:

    ds/dx = 45/32 (1 - y^4)^2,  y = 2 x - 1,  x = (tau - DWELL) / (1 - 2 DWELL)        z = 64 H (tau (1 - tau))^3

The blend's flat top keeps the peak speed at 1.41 times the mean; the quintic of least jerk needs 1.88 and a cycloid 2, which the
joints of small servos do not reach. DWELL keeps the foot from moving sideways while it is still unloading, or already loading.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import astuple, dataclass

import numpy as np

from hexapod_cosim.controller.gait import Gait
from hexapod_cosim.controller.kinematics import LEGS, Array, Mask
from hexapod_cosim.models import HexapodError

DWELL = 0.1  # 1    share of the swing at each end with vertical motion only
FREEZE = 0.75  # 1    part of the swing after which the landing point stays fixed to the ground
HOME_TOLERANCE = 1e-9  # m    a foot this close to its stance position need not step any more
CLOCK_EPSILON = 1e-9  # cycles    the clock starts this much before the first lift-off
NEARLY_DONE = 1e-12  # 1    floor of 1 - s
SMALL_ANGLE = 1e-12  # rad    below it sin(a)/a is 1
STRAIGHT = 1e-6  # rad/s    slower turns are aimed at as straight: the landing point is off by less than 1e-7 m

Twist = tuple[complex, float]  # vx + i vy [m/s], yaw rate [rad/s]


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
    """Turns steps of the command into smooth changes: a cubic from the present value and rate to the new value and rate 0."""

    def __init__(self, duration: float) -> None:
        self.duration = duration  # s
        self.value, self.rate = np.zeros(6), np.zeros(6)  # vx vy yaw_rate height roll pitch, and per second
        self.target = BodyCommand()
        self._cubic = np.zeros((4, 6))
        self._elapsed = duration

    @property
    def settled(self) -> bool:
        """The value is the target, and at rest."""
        return self._elapsed >= self.duration

    @property
    def level(self) -> bool:
        """The target is the nominal height and posture."""
        return self.target.height == 0.0 and self.target.roll == 0.0 and self.target.pitch == 0.0

    def aim(self, target: BodyCommand) -> None:
        """Heads for a command; repeating the present one changes nothing."""
        if target == self.target:
            return
        goal = np.array(astuple(target), dtype=np.float64)
        if not np.isfinite(goal).all():
            raise HexapodError("impossible body command", got=target, expected="finite numbers", fix="check where the command comes from")
        slope = self.rate * self.duration
        gap = goal - self.value
        self._cubic[:] = self.value, slope, 3.0 * gap - 2.0 * slope, slope - 2.0 * gap
        self.target, self._elapsed = target, 0.0

    def advance(self, period: float) -> None:
        """One step in time; the last one lands on the target exactly."""
        if self.settled:
            return
        self._elapsed += period
        if self.settled:
            self.value[:] = astuple(self.target)
            self.rate[:] = 0.0
            return
        x = self._elapsed / self.duration
        c0, c1, c2, c3 = self._cubic
        self.value[:] = c0 + x * (c1 + x * (c2 + x * c3))
        self.rate[:] = (c1 + x * (2.0 * c2 + 3.0 * x * c3)) / self.duration

    def reset(self) -> None:
        """Back to the zero command, at rest."""
        self.value[:] = self.rate[:] = 0.0
        self.target, self._elapsed = BodyCommand(), self.duration


class FootPaths:
    """The planned feet, advanced one period at a time.

    Attributes, (6,) each, in the walking frame:
        plane, height: feet's centres, x + i y and z [m];  plane_velocity, rise: their velocity [m/s];
        horizontal, vertical: (2, 6) the same in two blocks, each of position and velocity;
        landing: where swinging feet will touch down [m];  phase: in [0, 1);  swinging;  lifted: lift-off in the last step;
        progress, blend: tau and s of swinging feet, else 0.
    walking: the gait clock runs.
    """

    def __init__(self, gait: Gait, home: Array, *, period: float) -> None:
        self.gait, self.period = gait, period
        self.home, self.home_height = home[:, 0] + 1j * home[:, 1], home[:, 2].copy()
        self.swing_time = gait.period * (1.0 - gait.duty)
        self._landing_lead = 0.5 * gait.period * gait.duty + self.swing_time  # s    from lift-off to the middle of the next stance
        rows = np.empty((3, LEGS), dtype=np.complex128)
        self.landing, self.plane, self.plane_velocity = rows
        self._points, self.horizontal, self.vertical = rows[:2], rows[1:], np.empty((2, LEGS))
        self.height, self.rise = self.vertical
        self.phase, self.progress, self.blend = (np.empty(LEGS) for _ in range(3))
        self.swinging, self.lifted, self._standing = (np.empty(LEGS, dtype=np.bool_) for _ in range(3))
        self._homes: list[complex] = self.home.tolist()
        self._home_heights: list[float] = self.home_height.tolist()
        self._offsets = np.array(gait.offsets) + gait.start_clock() - CLOCK_EPSILON
        # full arrays: numpy is faster with them than with Python numbers
        self._one, self._duty = np.ones(LEGS), np.full(LEGS, gait.duty)
        self.reset()

    def reset(self) -> None:
        """All feet in the stance, clock stopped."""
        self.plane[:], self.landing[:], self.height[:] = self.home, self.home, self.home_height
        self.plane_velocity[:] = 0.0
        self.rise[:] = self.progress[:] = self.blend[:] = 0.0
        self.swinging[:] = self.lifted[:] = False
        self._rewind()

    def _rewind(self) -> None:
        self.walking = False
        self._steps = 0
        self.phase[:] = self._offsets % 1.0
        self._standing[:] = self.phase < self._duty  # a leg that begins in its swing phase waits for its next lift-off

    def advance(self, twist: Twist, mean_twist: Twist, *, going: bool) -> None:
        """One period on.

        Args:
            twist: (vx + i vy, yaw rate) at the end of the period [m/s, rad/s]; mean_twist: its mean over the period.
            going: the body moves or is commanded to; when False, feet step home and the clock then stops.
        """
        self.lifted.fill(False)
        if not self.walking:
            if not going:
                self.plane_velocity[:] = 0.0
                return
            self.walking = True
        self._carry(mean_twist)
        self._tick(going)
        # a foot on the ground: dp/dt = -(v + i w p)
        v, yaw_rate = twist
        self.plane_velocity.fill(-v)
        if yaw_rate != 0.0:
            self.plane_velocity -= 1j * yaw_rate * self.plane
        self.rise.fill(0.0)
        if True in self.swinging.tolist():
            self._swing(twist)
        elif not going and self._at_home().all():
            self._rewind()

    def _at_home(self) -> Mask:
        return np.asarray(np.abs(self.plane - self.home) < HOME_TOLERANCE)

    def _carry(self, twist: Twist) -> None:
        """Ground points drift past the body: p' = e^(-i w h) (p - d), d = v (e^(i w h) - 1)/(i w) its way under a constant twist."""
        v, yaw_rate = twist
        half = 0.5 * yaw_rate * self.period
        chord = math.sin(half) / half if abs(half) > SMALL_ANGLE else 1.0
        way = v * self.period * chord * cmath.rect(1.0, half)
        np.subtract(self._points, way, self._points)
        if yaw_rate != 0.0:
            np.multiply(self._points, cmath.rect(1.0, -2.0 * half), self._points)

    def _tick(self, going: bool) -> None:
        """Clock, lift-offs and touch-downs."""
        self._steps += 1
        np.add(self._offsets, self._steps * self.period / self.gait.period, self.phase)
        np.remainder(self.phase, self._one, self.phase)
        standing = self.phase < self._duty
        if standing.tobytes() == self._standing.tobytes():
            return
        landed = self.swinging & standing
        self.plane[landed] = self.landing[landed]
        self.height[landed] = self.home_height[landed]
        self.progress[landed] = self.blend[landed] = 0.0
        self.swinging[landed] = False
        np.logical_and(self._standing, ~standing, out=self.lifted)
        if not going:
            self.lifted &= ~self._at_home()
        self.swinging |= self.lifted
        self._standing[:] = standing

    def _swing(self, twist: Twist) -> None:
        """The feet in the air. Plain numbers: the few legs that swing are too few for arrays to pay."""
        duty, time = self.gait.duty, self.swing_time
        phase, before, lifted = self.phase.tolist(), self.blend.tolist(), self.lifted.tolist()
        landing, plane = self._points.tolist()
        for leg, swings in enumerate(self.swinging.tolist()):
            if not swings:
                continue
            tau = (phase[leg] - duty) / (1.0 - duty)
            goal, p = landing[leg], plane[leg]
            if tau < FREEZE or lifted[leg]:
                goal = self.landing[leg] = self._landing_point(leg, tau, twist)
            # the way to the landing point shrinks as 1 - s: p' = p + (s' - s)/(1 - s) (landing - p)
            s, slope = blend(tau)
            p += (s - before[leg]) / max(1.0 - before[leg], NEARLY_DONE) * (goal - p)
            self.plane[leg] = p
            self.plane_velocity[leg] += slope / (time * max(1.0 - s, NEARLY_DONE)) * (goal - p)
            lift, slope = hop(tau, top=self.gait.step_height, down=self.gait.touchdown_speed * time)
            self.height[leg] = self._home_heights[leg] + lift
            self.rise[leg] = slope / time
            self.progress[leg], self.blend[leg] = tau, s

    def _landing_point(self, leg: int, tau: float, twist: Twist) -> complex:
        """Where the ground under the stance position, half a stance after touch-down, is now."""
        v, yaw_rate = twist
        ahead = self._landing_lead - tau * self.swing_time
        if abs(yaw_rate) < STRAIGHT:
            return self._homes[leg] + ahead * v
        centre = 1j * v / yaw_rate  # of the turn
        return cmath.rect(1.0, yaw_rate * ahead) * (self._homes[leg] - centre) + centre


def blend(tau: float) -> tuple[float, float]:
    """s in [0, 1] and ds/dtau: s = 1/2 + 45/64 y - 9/32 y^5 + 5/64 y^9 between the dwells."""
    y = (2.0 * tau - 1.0) / (1.0 - 2.0 * DWELL)
    if y <= -1.0:
        return 0.0, 0.0
    if y >= 1.0:
        return 1.0, 0.0
    y4 = y * y * y * y
    flat = 1.0 - y4
    return 0.5 + y * (45.0 + y4 * (5.0 * y4 - 18.0)) / 64.0, 45.0 / 32.0 * flat * flat / (1.0 - 2.0 * DWELL)


def hop(tau: float, *, top: float, down: float) -> tuple[float, float]:
    """z and dz/dtau [m]: 64 top (tau (1 - tau))^3 + down tau^3 (1 - tau), down the touch-down speed times the swing's time."""
    arch = tau * (1.0 - tau)
    bow, fall = 64.0 * top * arch * arch, down * tau * tau
    return (bow + fall) * arch, 3.0 * bow * (1.0 - 2.0 * tau) + fall * (3.0 - 4.0 * tau)
