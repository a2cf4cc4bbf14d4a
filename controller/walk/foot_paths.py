"""Computes the paths of the feet from the motion of the body. C: foot_paths.h.

The walking frame K is the torso frame of a robot at its nominal height and level posture. It moves
over the ground with the velocity v = vx + i vy and the yaw rate w. Horizontal points are complex
numbers p = x + i y. The ground frame is the walking frame at the begin of the walk.

A swinging foot moves from the ground point that it left to the ground point where it will be
half-way through the next stance under its stance position. Both points are fixed to the ground, so
a blend (C6) whose ends have neither speed nor acceleration lets the foot leave and meet the ground
without sliding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask, Plane, cis, plane_of, some
from hexapod_cosim.controller.walk.gait import Gait
from hexapod_cosim.controller.walk.gait_clock import CLOCK_EPSILON, NO_LEG, GaitClock
from hexapod_cosim.controller.walk.kinematics import LegSolver
from hexapod_cosim.controller.walk.swing import Twist, blend, hop, odometry, travel

# 1/s, m/s    downwards, of feet that end their swings at once
DROP_RATE, LANDING_SPEED = 10.0, 0.08
FREEZE = 0.75  # 1    part of the swing after which the landing point stays fixed to the ground
SAME_DISTANCE = 1e-6  # m    distances that differ by less are equal
HOME_TOLERANCE = 1e-9  # m    a foot this close to its stance position need not step any more
NEARLY_DONE = 1e-12  # 1    floor of 1 - s


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


def _ground_motion(feet: PlannedFeet) -> Plane:
    """Returns the velocities (6,) of the body over the ground at its feet [m/s]."""
    return feet.twist.velocity + 1j * feet.twist.yaw_rate * feet.plane


class FootPaths(Stateful):
    """Paths of the feet within a section of the walk.

    Attributes:
        clock: the gait clock, which decides which legs swing.
        met: (6,) feet that have met the ground on their way down, and stay where they are.
        narrowing: part of the way to the narrow stance that the steps aim at.
    """

    STATE = ("clock", "met", "narrowing")

    def __init__(self, gait: Gait, legs: LegSolver, *, period: float) -> None:
        """Puts all feet in the stance. period: of the controller [s]."""
        self.gait, self.period = gait, period
        self.clock = GaitClock(gait, period=period)
        self.swing_time = gait.period * (1.0 - gait.duty)
        # from the lift-off to the middle of the next stance
        self.landing_lead = 0.5 * gait.period * gait.duty + self.swing_time
        home = legs.forward(legs.stance)
        self.home, self.home_height = plane_of(*home.T[:2]), home[:, 2].copy()  # m
        # m    from the stance to the narrow stance, and rolled outwards on this way
        self.inward = -gait.narrowing * cis(legs.hip_yaw + legs.stance[:, 0])
        self.turned = legs.rolling(legs.pose(self.home + self.inward, self.home_height).angle)
        self.met: Mask = NO_LEG
        self.narrowing = 0.0

    def _rest(self, plane: Plane) -> PlannedFeet:
        """Stops the gait clock at its begin; returns feet that stand still at `plane`."""
        nothing, still = np.zeros(LEGS), np.zeros(LEGS, dtype=np.complex128)
        self.clock.stop()
        self.met = NO_LEG
        return PlannedFeet(
            plane=plane,
            height=self.home_height,
            velocity=still,
            rise=nothing,
            phase=self.clock.phase_after(0),
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

    def aims(self) -> Plane:
        """Returns the stance positions (6,) that the steps aim at, walking frame [m] (C53)."""
        return np.asarray(self.home + self.narrowing * self.inward)

    def _come_home(self, swung: Mask, now: PlannedFeet) -> tuple[bool, Plane]:
        """Lets feet that are in their stance positions skip their steps.

        swung: (6,) legs that were in the air until now. Returns whether all feet stand there, and
        the positions of the feet (6,) [m]; a foot that has just landed is at its goal.
        """
        landed = swung & self.clock.standing
        feet = np.where(landed, cis(-now.turn) * (now.goal - now.way), now.plane)
        return self.clock.skip(np.abs(feet - self.aims()) < HOME_TOLERANCE), feet

    def _ground_of(self, feet: PlannedFeet) -> Plane:
        """Returns the feet (6,) in the ground frame [m] (C5)."""
        return feet.goal - feet.pull * (1.0 - feet.blend)

    def _place_feet(self, feet: PlannedFeet, tau: Array, carried: Plane) -> PlannedFeet:
        """Computes positions and velocities of feet with known goals and pulls (C5 to C8).

        tau: (6,) completed parts of swings; carried: (6,) feet a step earlier, ground frame [m].
        """
        clock, gait, away = self.clock, self.gait, self.clock.absent
        absent = some(away)
        if absent:  # these feet are above their stance positions
            place = feet.way + cis(feet.turn) * self.aims()
            goal, pull = np.where(away, place, feet.goal), np.where(away, 0.0, feet.pull)
            feet = feet._replace(goal=goal, pull=pull)
        R_KW = cis(-feet.turn)
        s, slope = blend(tau)
        lift, climb = hop(tau, top=gait.step_height, down=gait.touchdown_speed * self.swing_time)
        pace = 0.0 if clock.waiting else 1.0 / self.swing_time  # 1/s    of the feet on their paths
        rise = climb * pace
        if some(clock.dropped):
            high = feet.height - self.home_height
            fall = np.maximum(DROP_RATE * high, LANDING_SPEED)
            lift = np.where(clock.dropped, np.maximum(high - fall * self.period, 0.0), lift)
            rise = np.where(clock.dropped, -fall, rise)
        # a foot on the ground: dp/dt = -(v + i w p)
        was = R_KW * (carried - feet.way)
        motion = feet.twist.velocity + 1j * feet.twist.yaw_rate * was
        velocity = R_KW * feet.pull * (slope * pace) - motion
        height = self.home_height + np.where(clock.swinging, lift, 0.0)
        if absent:
            height = np.where(away, self.home_height + gait.step_height, height)
            velocity = np.where(away, 0.0, velocity)
        s = np.where(clock.swinging, s, 0.0)
        return feet._replace(
            plane=R_KW * (feet.goal - feet.pull * (1.0 - s) - feet.way),
            height=height,
            velocity=velocity,
            rise=np.where(clock.swinging, rise, 0.0),
            blend=s,
        )

    def _set_out(self, now: PlannedFeet, twist: Twist) -> PlannedFeet:
        """Computes the present step again, with the legs that swing in the new section."""
        clock = self.clock
        phase = clock.phase_after(clock.before)
        tau = clock.progress(phase)
        s = np.where(clock.swinging, blend(tau)[0], 0.0)
        pull = np.where(clock.swinging, now.pull, 0.0)
        feet = now._replace(phase=phase, blend=s, pull=pull, twist=twist)
        feet = self._place_feet(feet, tau, self._ground_of(feet))
        return feet._replace(height=np.where(clock.dropped, now.height, feet.height))

    def plan(self, now: PlannedFeet, number: int, *, going: bool, twist: Twist) -> PlannedFeet:
        """Begins a new section after the present step; returns its feet, as the section has them.

        now: the feet at the present step; number: periods since the last section began; twist: of
        the body now; going: the body moves or is commanded to, otherwise feet step home and the
        gait clock then stops.
        """
        clock = self.clock
        if not clock.walking and not going:
            return self._rest(now.plane)
        clock.land(self.down(now))
        swung, kept = clock.swinging, clock.stays
        clock.begin_section(number)
        if clock.ending:
            clock.keep_down(kept)
        elif not going:
            done, feet = self._come_home(swung, now)
            if done:
                return self._rest(feet)
        clock.set_out()
        return self._set_out(now, twist)

    def hold(self, now: PlannedFeet, number: int, *, twist: Twist) -> PlannedFeet:
        """Begins a section in which the gait clock stands still while the body moves on (C50).

        Arguments and result are those of plan().
        """
        self.clock.hold(number)
        return self._set_out(now, twist)

    def _lift_offs(self, begin: Array) -> Array:
        """Returns the times (6,) to the next lift-offs [s]. begin: (6,) present phases [cycles]."""
        left = self.gait.duty - begin + CLOCK_EPSILON
        return np.asarray((left - np.floor(left)) * self.gait.period)

    def _farthest(self, feet: PlannedFeet, begin: Array) -> float:
        """Returns how far the farthest foot will be from its stance position at its lift-off [m]
        (C55). feet: that stand; begin: (6,) phases at the begin of the walk [cycles].
        """
        time, motion = self._lift_offs(begin), _ground_motion(feet)
        far = np.abs(feet.plane - motion * time - self.aims())
        return float(far[~self.clock.absent].max())

    def join(self, feet: PlannedFeet, returning_leg: int | None = None) -> PlannedFeet:
        """Begins the walk anew with feet that stand under a moving body (C55).

        One leg begins to give up its load: the first of those with which the farthest foot goes
        least far; with one leg out of service the first of the gait (C58). A leg that is back in
        service instead begins in the middle of its swing.
        """
        clock = self.clock
        if not clock.walking:
            return self._rest(feet.plane)
        least = np.inf
        unloads, offset = clock.unloads, np.array(self.gait.offsets)
        if returning_leg is not None:
            clock.start_at(0.5 + 0.5 * self.gait.duty + offset - offset[returning_leg])
        able = offset == 0.0 if clock.absent.sum() == 1 else ~clock.absent
        for first in np.flatnonzero(able) if returning_leg is None else ():
            begin = unloads + (offset - offset[first])
            far = self._farthest(feet, begin)
            if far < least - SAME_DISTANCE:
                least = far
                clock.start_at(begin)
        clock.start_standing(returning_leg)
        self.met = NO_LEG
        return feet

    def down(self, feet: PlannedFeet) -> Mask:
        """Returns the dropped feet (6,) that have reached the ground."""
        dropped = self.clock.dropped & self.clock.swinging
        return dropped & (feet.height <= self.home_height)

    def _landing(self, tau: Array, twist: Twist) -> Plane:
        """Returns the landing points (6,) in the walking frame [m] (C4, C53)."""
        ahead = self.landing_lead - tau * self.swing_time
        return np.asarray(cis(twist.yaw_rate * ahead) * self.aims() + travel(twist, ahead))

    def walk(self, number: int, twist: Twist, before: PlannedFeet) -> PlannedFeet:
        """Returns the feet `number` periods after the section began. before: a step earlier."""
        clock = self.clock
        if not clock.walking:
            return before
        step, yaw = odometry(before.twist, twist, self.period)
        way, turn = complex(before.way + cis(before.turn) * step), before.turn + yaw
        phase = clock.phase_after(clock.reached(number))
        tau = clock.progress(phase)
        free = clock.swinging & (tau < FREEZE)
        if number == 1:
            free = free | (clock.swinging & clock.lifted)  # every foot is aimed once
        goal, pull, left = before.goal, before.pull, np.maximum(1.0 - before.blend, NEARLY_DONE)
        if some(free):
            goal = np.where(free, way + cis(turn) * self._landing(tau, twist), before.goal)
            pull = before.pull + (goal - before.goal) / left
        fixed, ground = self.met | clock.dropped, self._ground_of(before)
        if some(fixed):  # a foot stays where it met the ground (C51), or is dropped
            goal, pull = np.where(fixed, ground, goal), np.where(fixed, 0.0, pull)
        feet = before._replace(phase=phase, goal=goal, pull=pull, way=way, turn=turn, twist=twist)
        feet = self._place_feet(feet, tau, ground)
        if self.narrowing == 0.0 and not some(before.rolled):
            return feet
        aim = self.narrowing * self.turned
        rolls = aim - (aim - before.rolled) * (1.0 - feet.blend) / left
        return feet._replace(rolled=np.where(clock.swinging & ~self.met, rolls, before.rolled))
