"""What a step of the integrator did: works and losses (eq. 27), and what is integrated along the
step's path (eq. 28).

A step of h [s] leads from one set of body states (19, 13) to another. The integrator adds up the
impulses of its own stage forces; everything else here follows from both ends. The fast form is
plant_fmu/src/lanes/measure.h.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hexapod_cosim.models.actuator import servo_torque
from hexapod_cosim.models.contact import foot_contacts, normal_force
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.kinematics import (
    JOINTS,
    LEGS,
    cross,
    foot_centres,
    joint_angles,
    joint_speeds,
)
from hexapod_cosim.models.records import Array, Robot

NODES = np.linspace(
    0.0, 1.0, 5
)  # of a step, at which the laws of feet are evaluated; those of motors at every second one
FOOT_WEIGHTS = np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12.0  # Simpson's rule
MOTOR_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
LOAD_SHARE = 0.01  # of the robot's weight: a foot that bears more slips under load
LANDING_SAMPLE = 1e-4  # s    between two forces of a landing
LANDING_SAMPLES = 200  # of a landing, which is over 20 ms after touch-down
CONE_BINS, NEARLY_SLIDING = (
    31,
    0.9,
)  # of the shares of the friction cone that feet use; where the last one begins
RISE_SAMPLES = 10  # across the window of 1 ms over which a landing's force rises


@dataclass(frozen=True)
class Impulses:
    """Impulses of a step's forces: h times the stage forces, weighted as the stages are."""

    motor: Array  # (6, 3) N m s  motors on their joints
    gear: Array  # (6, 3) N m s  gear friction on the joints
    foot: Array  # (6, 3) N s    ground on feet, world axes


@dataclass(frozen=True)
class Works:
    """Works of the motors on the joints, and what contacts, friction and gears took, all [J]."""

    motor: Array  # (6, 3)
    contact: float
    friction: float
    gear: float


@dataclass(frozen=True)
class Measured:
    """What a step adds to the plant's outputs of the same names, and its peaks."""

    positive_work: Array  # (6, 3) J
    negative_work: Array  # (6, 3) J, >= 0
    torque_squared: Array  # (6, 3) N2 m2 s
    slip_distance: Array  # (6,) m
    impulse: Array  # (6,) N s
    peak_force: Array  # (6,) N
    peak_force_rate: Array  # (6,) N/s, >= 0


def _wrapped(angle: Array) -> Array:
    """Angles [rad] of any shape within half a turn."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def mean_slip(robot: Robot, before: Array, after: Array, h: float) -> Array:
    """(6, 3) mean velocity [m/s] of the contact points' material along the ground: the way of
    the feet's centres, and their rolling.
    """
    slips = []
    ends = [
        (foot_centres(robot, body), foot_contacts(robot, body), body) for body in (before, after)
    ]
    for leg in range(LEGS):
        way = ends[1][0][leg] - ends[0][0][leg]
        normal = 0.5 * (ends[0][1][leg].normal + ends[1][1][leg].normal)
        rolling = [
            cross(body[JOINTS * (leg + 1), 10:13], -robot.foot.radius * feet[leg].normal)
            for _, feet, body in ends
        ]
        slips.append((way - (way @ normal) * normal) / h + 0.5 * (rolling[0] + rolling[1]))
    return np.array(slips)


def step_works(
    robot: Robot, before: Array, after: Array, h: float, impulses: Impulses, closed: Array
) -> Works:
    """Works of a step (eq. 27): impulses times the mean of the speeds at its ends. closed (6,):
    feet in contact during the step.

    Contact takes the work of the normal force less the growth of its stored energy 2/5 K
    delta^(5/2).
    """
    speed = 0.5 * (joint_speeds(robot, before) + joint_speeds(robot, after))
    contact = friction = 0.0
    for leg, (first, last) in enumerate(
        zip(foot_contacts(robot, before), foot_contacts(robot, after), strict=True)
    ):
        normal = 0.5 * (first.normal + last.normal)
        depths = np.maximum([first.penetration, last.penetration], 0.0)
        stored = 0.4 * robot.contact.stiffness * depths**2.5 * closed[leg]
        contact += float(impulses.foot[leg] @ normal) * 0.5 * (
            first.approach_speed + last.approach_speed
        ) - float(stored[1] - stored[0])
        slips = [foot.velocity + foot.approach_speed * foot.normal for foot in (first, last)]
        friction -= float(impulses.foot[leg] @ (0.5 * (slips[0] + slips[1])))
    return Works(impulses.motor * speed, contact, friction, -float(np.sum(impulses.gear * speed)))


def cone_time(robot: Robot, before: Array, after: Array, h: float, impulses: Impulses) -> Array:
    """(31,) time [s] that feet bore load in a step, summed over them, by the share |f_t|/(mu f_n)
    of the friction cone (eq. 30).

    The share is that of the step's impulses. Bins begin at 0.9 (i/30)^2.
    """
    time = np.zeros(CONE_BINS)
    least = h * LOAD_SHARE * robot.total_mass * float(np.linalg.norm(robot.gravity))
    edges = NEARLY_SLIDING * (np.arange(CONE_BINS) / (CONE_BINS - 1)) ** 2
    for leg, (first, last) in enumerate(
        zip(foot_contacts(robot, before), foot_contacts(robot, after), strict=True)
    ):
        normal = 0.5 * (first.normal + last.normal)
        pressed = float(impulses.foot[leg] @ normal)
        if pressed > least:
            share = float(np.linalg.norm(impulses.foot[leg] - pressed * normal)) / (
                robot.friction.mu * pressed
            )
            time[np.flatnonzero(edges <= share)[-1]] += h
    return time


def cubic(
    start: Array, slope_start: Array, rise: Array, slope_end: Array, x: Array
) -> tuple[Array, Array, Array]:
    """Value, rate and second rate at x (nodes,) in [0, 1] of the cubics through values and rates
    per step at both ends (eq. 28).
    """
    bend = slope_start + slope_end - 2.0 * rise
    curve = rise - slope_start - bend
    x = x.reshape(-1, *(1 for _ in np.shape(start)))
    value = start + x * (slope_start + x * (curve + x * bend))
    return value, slope_start + x * (2.0 * curve + 3.0 * x * bend), 2.0 * curve + 6.0 * x * bend


def measured_step(
    robot: Robot,
    before: Array,
    after: Array,
    h: float,
    command: Command,
    work: Array,
    damping: Array,
) -> Measured:
    """What a step did along its path, in position or torque mode.

    work: (6, 3) the motors' works of `step_works` [J]; damping: (6,) d of eq. 14 [s/m], nan for
    feet that are open during the step.
    """
    joints = _joints(robot, before, after, h, command, work)
    return Measured(*joints, *_feet(robot, before, after, h, damping))


def _joints(
    robot: Robot, before: Array, after: Array, h: float, command: Command, work: Array
) -> tuple[Array, Array, Array]:
    """Positive and negative work and the squared torque's integral, each (6, 3)."""
    angle, speeds = (
        joint_angles(robot, before),
        [h * joint_speeds(robot, body) for body in (before, after)],
    )
    rise = _wrapped(joint_angles(robot, after) - angle)
    value, rate, _ = cubic(angle, speeds[0], rise, speeds[1], NODES[::2])
    told = (command.angle_ref, command.speed_ref, command.torque_ref)
    torque = servo_torque(
        robot.servo,
        _wrapped(value),
        rate / h,
        *(np.broadcast_to(part, value.shape) for part in told),
    )
    power = torque * rate / h
    positive, negative, squared = (
        h * np.tensordot(MOTOR_WEIGHTS, part, 1)
        for part in (np.maximum(power, 0.0), np.maximum(-power, 0.0), torque**2)
    )
    rest = work - (
        positive - negative
    )  # what the path misses of the step's work goes to the larger part
    drives = positive > negative
    positive, negative = (
        positive + np.where(drives, rest, 0.0),
        negative - np.where(drives, 0.0, rest),
    )
    excess = np.minimum(np.minimum(positive, negative), 0.0)
    return positive - excess, negative - excess, squared


def _feet(
    robot: Robot, before: Array, after: Array, h: float, damping: Array
) -> tuple[Array, Array, Array, Array]:
    """Slip under load, impulse, largest normal force and its steepest rise, each (6,)."""
    ends = foot_contacts(robot, before), foot_contacts(robot, after)
    delta = [np.array([foot.penetration for foot in feet]) for feet in ends]
    slope = [h * np.array([foot.approach_speed for foot in feet]) for feet in ends]
    depth, rate, second = cubic(delta[0], slope[0], delta[1] - delta[0], slope[1], NODES)
    d, closed = np.nan_to_num(damping), ~np.isnan(damping)
    elastic = np.where(closed, robot.contact.stiffness * np.maximum(depth, 0.0) ** 1.5, 0.0)
    factor = 1.0 + d * rate / h
    force = elastic * np.maximum(factor, 0.0)
    stiffness = np.where(
        closed & (factor > 0.0),
        1.5 * robot.contact.stiffness * np.sqrt(np.maximum(depth, 0.0)) * factor,
        0.0,
    )
    rises = stiffness * rate / h + np.where(factor > 0.0, elastic * d, 0.0) * second / h**2
    slips = [
        np.array([foot.velocity + foot.approach_speed * foot.normal for foot in feet])
        for feet in ends
    ]
    x = NODES[:, None, None]
    slip = (
        (1.0 - x * (4.0 - 3.0 * x)) * slips[0]
        + x * (3.0 * x - 2.0) * slips[1]
        + 6.0 * x * (1.0 - x) * mean_slip(robot, before, after, h)
    )
    slipped = _under_load(robot, h, force, np.linalg.norm(slip, axis=-1))
    return slipped, h * FOOT_WEIGHTS @ force, force.max(axis=0), np.maximum(rises.max(axis=0), 0.0)


def landing_rate(robot: Robot, time: Array, delta: Array, ddelta: Array, damping: Array) -> float:
    """Largest rise [N/s] of one foot's normal force over 1 ms, in windows that end every 0.1 ms of
    the 20 ms after touch-down (eq. 29).

    time (n,) [s]: ends of the steps since touch-down, which is the first; delta, ddelta (n,) [m,
    m/s]: penetration and approach speed there; damping (n - 1,): d of eq. 14 [s/m] during the
    steps, nan where the foot is open. Before touch-down there is no force.
    """
    samples = np.arange(1, LANDING_SAMPLES + 1) * LANDING_SAMPLE + time[0]
    force = [
        _force_at(robot, t, time, delta, ddelta, damping) for t in samples[samples <= time[-1]]
    ]
    before = [0.0] * RISE_SAMPLES + force
    rises = [late - early for late, early in zip(force, before, strict=False)]
    return max([0.0, *rises]) / (RISE_SAMPLES * LANDING_SAMPLE)


def _force_at(
    robot: Robot, t: float, time: Array, delta: Array, ddelta: Array, damping: Array
) -> float:
    """Normal force [N] of a foot at a time within its steps."""
    k = max(int(np.searchsorted(time, t)) - 1, 0)
    h = time[k + 1] - time[k]
    depth, rate, _ = cubic(
        delta[k],
        h * ddelta[k],
        delta[k + 1] - delta[k],
        h * ddelta[k + 1],
        np.array([(t - time[k]) / h]),
    )
    return normal_force(robot.contact, float(damping[k]), float(depth[0]), float(rate[0] / h))


def _under_load(robot: Robot, h: float, force: Array, speed: Array) -> Array:
    """(6,) integral of the slip speed over where the force, linear between nodes, exceeds
    LOAD_SHARE of the weight.
    """
    mass = robot.torso.mass + sum(link.mass for leg in robot.legs for link in leg.links)
    above = force - LOAD_SHARE * mass * float(np.linalg.norm(robot.gravity))
    total = np.zeros(LEGS)
    for (a, b), (v, w) in zip(pairwise(above), pairwise(speed), strict=True):
        crossing = np.abs(a) / np.maximum(np.abs(a) + np.abs(b), 1e-300)
        low = np.where(a > 0.0, 0.0, np.where(b > 0.0, crossing, 1.0))
        high = np.where(b > 0.0, 1.0, np.where(a > 0.0, crossing, low))
        total += h * (NODES[1] - NODES[0]) * (high - low) * (v + 0.5 * (low + high) * (w - v))
    return total
