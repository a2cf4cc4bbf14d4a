"""Measures a step of the integrator: works and losses (eq. 27), and integrals along its path (eq.
28).

A step of h [s] leads from one set of body states (19, 13) to another. The integrator supplies the
impulses of its stage forces; all other quantities follow from both ends.
plant_fmu/src/measure is the fast form.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from hexapod_cosim.models.actuator import servo_torque, stop_energy
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import FootContact, foot_contacts, slip_velocity
from hexapod_cosim.models.contact.law import normal_force
from hexapod_cosim.models.dynamics import Command, joint_overruns
from hexapod_cosim.models.kinematics import (
    JOINTS,
    LEGS,
    cross,
    foot_centres,
    joint_angles,
    joint_speeds,
)
from hexapod_cosim.models.method import cubic, parabola
from hexapod_cosim.models.records import Robot

# nodes of a step for the forces of feet; motors use every second one
NODES = np.linspace(0.0, 1.0, 5)
FOOT_WEIGHTS = np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12.0  # Simpson's rule
MOTOR_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
LOAD_SHARE = 0.01  # 1  of the weight; a foot with a larger load counts its slip
LANDING_SAMPLE = 1e-4  # s  between two forces of a landing
LANDING_SAMPLES = 200  # samples of a landing, which lasts 20 ms
CONE_BINS = 31  # bins of the share of the friction cone
NEARLY_SLIDING = 0.9  # 1  start of the last bin
CONE_STARTS = NEARLY_SLIDING * (np.arange(CONE_BINS) / (CONE_BINS - 1)) ** 2  # 1  of the bins
RISE_SAMPLES = 10  # samples in the rise window of 1 ms


@dataclass(frozen=True)
class Impulses:
    """Impulses of a step's forces: h times the stage forces with the stages' weights."""

    motor: Array  # (6, 3) N m s  motors on their joints
    gear: Array  # (6, 3) N m s  gear friction on the joints
    foot: Array  # (6, 3) N s    ground on feet, world axes
    # (6, 3) N m s  stops on the joints
    stop: Array = field(default_factory=lambda: np.zeros((LEGS, JOINTS)))
    # (6, 3) N m s  spin and rolling friction on tibias, world axes
    moment: Array = field(default_factory=lambda: np.zeros((LEGS, 3)))


@dataclass(frozen=True)
class Works:
    """Works of the motors on the joints, and losses in contacts, friction and gears with stops
    [J].
    """

    motor: Array  # (6, 3)
    contact: float
    friction: float
    gear: float


def _wrapped(angle: Array) -> Array:
    """Returns angles [rad] of any shape, wrapped to [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def mean_slip(robot: Robot, before: Array, after: Array, h: float) -> Array:
    """Returns the mean velocity (6, 3) [m/s] of the contact points' material along the ground.

    It consists of the displacement of the feet's centres and their rolling.
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


def contact_works(
    robot: Robot, first: FootContact, last: FootContact, impulse: Array
) -> tuple[float, float]:
    """Returns what a closed contact and its friction lose in a step [J] (eq. 27).

    The loss in contact is the work of the normal force minus the growth of the stored energy 2/5 K
    delta^(5/2). first, last: the contact at both ends; impulse: (3,) of the ground [N s].
    """
    approach = 0.5 * (first.approach_speed + last.approach_speed)
    depths = np.maximum([first.penetration, last.penetration], 0.0)
    before, after = 0.4 * robot.contact.stiffness * depths**2.5
    slip = 0.5 * (slip_velocity(first) + slip_velocity(last))
    taken = float(impulse @ (0.5 * (first.normal + last.normal))) * approach
    return taken - float(after - before), -float(impulse @ slip)


def push_work(before: Array, after: Array, impulse: Array) -> float:
    """Returns the work [J] of the push's impulses (6,) on the torso [N s, N m s] (eq. 27)."""
    return float(impulse @ (before + after)[0, 7:13]) / 2.0


def step_works(
    robot: Robot, before: Array, after: Array, h: float, impulses: Impulses, closed: Array
) -> Works:
    """Returns the works of a step (eq. 27): impulses times the mean of the speeds at its ends.

    The loss of the stops is their work minus the growth of k x^2/2. closed (6,): feet in contact
    during the step.
    """
    speed = 0.5 * (joint_speeds(robot, before) + joint_speeds(robot, after))
    contact = friction = 0.0
    feet = [foot_contacts(robot, body) for body in (before, after)]
    for leg in np.flatnonzero(closed):
        losses = contact_works(robot, feet[0][leg], feet[1][leg], impulses.foot[leg])
        twice_w = (before + after)[JOINTS * (leg + 1), 10:13]
        contact += losses[0]
        friction += losses[1] - float(impulses.moment[leg] @ twice_w) / 2.0
    gear = -float(np.sum((impulses.gear + impulses.stop) * speed))
    stored = [stop_energy(robot.servo, joint_overruns(robot, body)) for body in (before, after)]
    gear -= float(np.sum(stored[1] - stored[0]))
    return Works(impulses.motor * speed, contact, friction, gear)


def measure_cone(robot: Robot, before: Array, after: Array, h: float, impulses: Impulses) -> Array:
    """Returns the time (31,) [s] of feet under load in a step, by the share of the friction cone
    (eq. 30).

    The share is |f_t|/(mu f_n) of the step's impulses. Bin i begins at 0.9 (i/30)^2; times are
    summed over the feet.
    """
    time = np.zeros(CONE_BINS)
    least = h * LOAD_SHARE * robot.total_mass * float(np.linalg.norm(robot.gravity))
    for leg, (first, last) in enumerate(
        zip(foot_contacts(robot, before), foot_contacts(robot, after), strict=True)
    ):
        normal = 0.5 * (first.normal + last.normal)
        pressed = float(impulses.foot[leg] @ normal)
        if pressed > least:
            share = float(np.linalg.norm(impulses.foot[leg] - pressed * normal)) / (
                robot.friction.mu * pressed
            )
            time[np.flatnonzero(share >= CONE_STARTS)[-1]] += h
    return time


def measure_joints(
    robot: Robot, before: Array, after: Array, h: float, command: Command, work: Array
) -> tuple[Array, Array, Array]:
    """Returns positive and negative work [J] and the integral of the squared torque [N2 m2 s], each
    (6, 3), in position or torque mode. work: (6, 3) the motors' works of `step_works` [J].
    """
    angle = joint_angles(robot, before)
    speeds = [h * joint_speeds(robot, body) for body in (before, after)]
    rise = _wrapped(joint_angles(robot, after) - angle)
    value, rate, _ = cubic(angle, speeds[0], rise, speeds[1], NODES[::2])
    references = (command.angle_ref, command.speed_ref, command.torque_ref)
    torque = servo_torque(
        robot.servo,
        _wrapped(value),
        rate / h,
        *(np.broadcast_to(part, value.shape) for part in references),
    )
    power = torque * rate / h
    positive, negative, squared = (
        h * np.tensordot(MOTOR_WEIGHTS, part, 1)
        for part in (np.maximum(power, 0.0), np.maximum(-power, 0.0), torque**2)
    )
    # the difference from the step's work is added to the larger part
    rest = work - (positive - negative)
    drives = positive > negative
    positive = positive + np.where(drives, rest, 0.0)
    negative = negative - np.where(drives, 0.0, rest)
    excess = np.minimum(np.minimum(positive, negative), 0.0)
    return positive - excess, negative - excess, squared


def measure_feet(
    robot: Robot, before: Array, after: Array, h: float, damping: Array
) -> tuple[Array, Array, Array, Array]:
    """Returns slip under load [m], impulse [N s], largest normal force [N] and its steepest rise
    >= 0 [N/s], each (6,). damping: (6,) d of eq. 14 [s/m], nan for feet that are open.
    """
    ends = foot_contacts(robot, before), foot_contacts(robot, after)
    delta = [np.array([foot.penetration for foot in feet]) for feet in ends]
    slope = [h * np.array([foot.approach_speed for foot in feet]) for feet in ends]
    depth, rate, second = cubic(delta[0], slope[0], delta[1] - delta[0], slope[1], NODES)
    d, closed = np.nan_to_num(damping), ~np.isnan(damping)
    K, root = robot.contact.stiffness * closed, np.sqrt(np.maximum(depth, 0.0))
    factor, elastic = np.maximum(1.0 + d * rate / h, 0.0), K * root**3
    force, stiffness = elastic * factor, 1.5 * K * root * factor
    rises = stiffness * rate / h + np.where(factor > 0.0, elastic * d, 0.0) * second / h**2
    slips = [np.array([slip_velocity(foot) for foot in feet]) for feet in ends]
    slip = parabola(slips[0], slips[1], mean_slip(robot, before, after, h), NODES)
    slipped = _under_load(robot, h, force, np.linalg.norm(slip, axis=-1))
    return slipped, h * FOOT_WEIGHTS @ force, force.max(axis=0), np.maximum(rises.max(axis=0), 0.0)


def measure_landing(
    robot: Robot, time: Array, delta: Array, ddelta: Array, damping: Array
) -> float:
    """Returns the largest rise [N/s] of a foot's normal force over 1 ms of a landing (eq. 29).

    The windows end every 0.1 ms of the 20 ms after touch-down; forces before touch-down are 0.

    Args:
        robot: the robot.
        time: (n,) ends of the steps since touch-down, which is the first [s].
        delta, ddelta: (n,) penetration and approach speed there [m, m/s].
        damping: (n - 1,) d of eq. 14 during the steps [s/m], nan where the foot is open.
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
    """Returns the normal force [N] of a foot at a time within its steps."""
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
    """Returns the integral (6,) of the slip speed over times at which the foot bears load.

    The force is linear between nodes; load is a force above LOAD_SHARE of the weight.
    """
    above = force - LOAD_SHARE * robot.total_mass * float(np.linalg.norm(robot.gravity))
    total = np.zeros(LEGS)
    for (a, b), (v, w) in zip(pairwise(above), pairwise(speed), strict=True):
        crossing = np.abs(a) / np.maximum(np.abs(a) + np.abs(b), 1e-300)
        low = np.where(a > 0.0, 0.0, np.where(b > 0.0, crossing, 1.0))
        high = np.where(b > 0.0, 1.0, np.where(a > 0.0, crossing, low))
        total += h * (NODES[1] - NODES[0]) * (high - low) * (v + 0.5 * (low + high) * (w - v))
    return total
