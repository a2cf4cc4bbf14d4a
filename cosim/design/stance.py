"""Finds the stance in which the servos of a walking robot heat up least.

Two lengths are varied, the same for all legs: how far the feet stand out from the hips, and how
deep below them, the latter by no more than 15 % of the torso's height. The heat is the mean sum of
squared servo torques over a cycle of the robot's gait at its stride, at the planned loads (C19,
C20, C42) and without accelerations. A stance is allowed when the legs reach all steps of the gait
with a reserve and lift their feet, no joint needs more than the speed limit or its present speed,
neighbouring feet keep apart, and the robot stands as firmly as its own stance or a quarter of
gravity sideways requires.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from hexapod_cosim.controller import (
    BodyCommand,
    Controller,
    GainsError,
    Gait,
    LegSolver,
    Measurement,
    Parts,
)
from hexapod_cosim.controller.comply.planned_squeeze import PlannedSqueeze
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.gains import SupportGains
from hexapod_cosim.controller.plane import cis
from hexapod_cosim.controller.size import requirements_for
from hexapod_cosim.controller.walk.inverse_dynamics import InverseDynamics, Neighbours
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.models import ReachError, Robot
from hexapod_cosim.models.arrays import Array

PHASES = 24  # moments of a gait cycle at which loads are computed
STEPS = 60  # periods of the cycle whose joint angles and speeds are checked
RESERVE = 1.25  # 1    stride that the legs must reach, over that of the gait
SPEED_SHARE = 0.8  # 1    of a servo's largest speed that a walk may need
FIRMNESS = 0.25  # 1    distance of the centre of mass from the polygon's edge, of its height
APART = 4.0  # 1    radii of a foot between the ranges of neighbouring feet
UNLIMITED = 1e6  # rad/s    largest speed of joints that no walk reaches
LIFTED = 0.5  # 1    of the step height, by which a foot can be lifted at least
HIGHER = 0.15  # 1    of the depth of the ground: most change of the torso's height
FIRST_STEP, LAST_STEP = 0.16, 0.01  # 1    of the depth of the ground: sizes of the search's steps


@dataclass(frozen=True)
class StanceLoads:
    """Loads of a stance on one walk."""

    heat: float  # N2 m2    mean over the cycle of the sum of squared torques
    hottest: float  # N m    largest RMS torque of a servo
    firmness: float  # 1    least distance from the edge of the feet's polygon, over the height
    speed: float  # rad/s    largest speed of a joint; infinite where a standing leg does not reach
    lifts: bool  # the joints can lift each foot by half the step height, anywhere on its way


class StanceChange(NamedTuple):
    """By how much a robot's feet are moved from its own stance."""

    outward: float  # m    further out from the hips
    deeper: float  # m    below them


def find_stance(robot: Robot, gait: Gait) -> StanceChange:
    """Finds the stance of least heat near the robot's own, by a search in two lengths.

    The search tries the eight neighbours at the present step size, moves to the best allowed one,
    and halves the size when there is none. Raises GainsError for a robot whose own stance does not
    reach the steps of its gait.
    """
    before = stance_loads(robot, gait)
    if not np.isfinite(before.speed):
        raise GainsError(
            "the legs do not reach the steps of the gait",
            got=f"stride {robot.gait.stride:g} m, with a reserve of {RESERVE:g}",
            expected="a stance from which the search can start",
            fix="shorten gait.stride in the robot file",
            where=robot.name,
        )
    unit = _depth(robot)
    best, heat, size = StanceChange(0.0, 0.0), before.heat, FIRST_STEP
    while size >= LAST_STEP:
        found = _best_neighbour(robot, gait, best, size * unit, before, heat)
        if found is None:
            size *= 0.5
        else:
            best, heat = found
    return best


def _best_neighbour(
    robot: Robot, gait: Gait, place: StanceChange, size: float, before: StanceLoads, heat: float
) -> tuple[StanceChange, float] | None:
    """Returns the allowed neighbour of least heat below `heat`, with its heat."""
    found = None
    for out, down in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        there = StanceChange(place.outward + out * size, place.deeper + down * size)
        if abs(there.deeper) > HIGHER * _depth(robot):
            continue
        try:
            moved = with_stance(robot, *there)
        except ReachError:
            continue
        torques, _ = _loads(moved, gait)
        if _heat(torques) >= heat:  # the other checks take longer
            continue
        loads = stance_loads(moved, gait)
        if _allowed(moved, gait, loads, before):
            found, heat = (there, loads.heat), loads.heat
    return found


def _allowed(robot: Robot, gait: Gait, loads: StanceLoads, before: StanceLoads) -> bool:
    """Returns whether a stance is as firm, as slow and as free of its neighbours as required."""
    firm = min(FIRMNESS, before.firmness)
    fast = max(SPEED_SHARE * robot.servo.speed_max, before.speed)
    lifts = loads.lifts or not before.lifts
    return lifts and loads.firmness >= firm and loads.speed <= fast and _gap(robot, gait) >= 0.0


def with_stance(robot: Robot, outward: float, deeper: float) -> Robot:
    """Returns the robot with its feet moved outwards in their legs' planes and downwards [m].

    Raises ReachError where a leg does not reach.
    """
    legs = LegSolver(robot)
    feet = legs.forward(robot.stance)
    heading = cis(legs.hip_yaw + robot.stance[:, 0])
    moved = feet + np.column_stack(
        [outward * heading.real, outward * heading.imag, np.full(len(feet), -deeper)]
    )
    angles = legs.inverse(moved)
    changed = tuple(
        replace(leg, stance=tuple(angle))
        for leg, angle in zip(robot.legs, angles.tolist(), strict=True)
    )
    return replace(robot, legs=changed)


def stance_loads(robot: Robot, gait: Gait) -> StanceLoads:
    """Returns the loads of a robot's stance on a straight walk at its stride."""
    torques, firmness = _loads(robot, gait)
    squares = (torques * torques).mean(axis=0)
    return StanceLoads(
        heat=_heat(torques),
        hottest=float(np.sqrt(squares.max())),
        firmness=firmness,
        speed=settled_motion(robot, gait, _stride_command(robot, gait)).speed,
        lifts=_lifts(robot, gait),
    )


def _heat(torques: Array) -> float:
    """Returns the mean over the cycle of the sum of squared torques (PHASES, 6, 3) [N2 m2]."""
    return float((torques * torques).mean(axis=0).sum())


def _depth(robot: Robot) -> float:
    return -InverseDynamics(robot, LegSolver(robot), period=1.0).floor


def _loads(robot: Robot, gait: Gait) -> tuple[Array, float]:
    """Returns the servo torques (PHASES, 6, 3) [N m] and the least firmness (`StanceLoads`)."""
    legs, needs = LegSolver(robot), requirements_for(robot)
    dynamics = InverseDynamics(robot, legs, period=1.0)  # the period is not used without motion
    timing = SupportGains(
        handover_time=needs.handover_time, weight_time=needs.weight_time, load_time=needs.load_time
    )
    support = Support(robot, gait, timing, rest=dynamics.rest())
    planned = PlannedSqueeze(friction=robot.friction.mu, weight=robot.weight, depth=-dynamics.floor)
    home, level = legs.forward(robot.stance), Posture.of(np.zeros(3), np.zeros(3))
    torques, firmness = np.zeros((PHASES, len(home), 3)), np.inf
    for k in range(PHASES):
        phase = gait.phase((k + 0.5) / PHASES)
        stands, along, lift = _steps(phase, gait, robot.gait.stride)
        plane = np.asarray(home[:, 0] + 1j * home[:, 1] + along, dtype=np.complex128)
        pose = legs.pose(plane, home[:, 2] + lift)
        masses = dynamics.place(pose, 0j, 0.0, level)
        alone = Neighbours((None, masses, None), (None, pose, None))
        demand = dynamics.demand(alone, np.zeros_like(pose.angle), level)
        shares = support.shares(plane, stands.astype(float), demand)
        shares = planned.add(plane, demand, shares, Parts().squeeze)
        carried = (demand.lever @ shares.forces()[:, :, None])[:, :, 0]
        torques[k] = demand.torque - carried
        centre = demand.moment / demand.weight
        firmness = min(firmness, _edge_distance(plane[stands], centre) / -dynamics.floor)
    return torques, firmness


def _steps(phase: Array, gait: Gait, stride: float) -> tuple[Any, Array, Array]:
    """Returns which legs stand, their way along x and their lift [m] at phases (6,).

    stride: of the body in a period [m].
    """
    stands, way = phase < gait.duty, stride * gait.duty
    swing = np.clip((phase - gait.duty) / (1.0 - gait.duty), 0.0, 1.0)
    along = np.where(stands, way * (0.5 - phase / gait.duty), way * (swing - 0.5))
    return stands, along, 64.0 * gait.step_height * (swing * (1.0 - swing)) ** 3


def _edge_distance(feet: Any, point: complex) -> float:
    """Returns the least distance of a point from the edges of the feet's convex polygon [m].

    It is negative outside. Every pair of feet that has all others on its left is an edge.
    """
    least = np.inf
    for a in feet:
        for b in feet:
            length = abs(b - a)
            if length == 0.0:
                continue
            inward = 1j * (b - a) / length
            sides = ((feet - a) * inward.conjugate()).real
            if sides.min() >= -1e-12 * length and sides.max() > 0.0:
                least = min(least, ((point - a) * inward.conjugate()).real)
    return float(least) if np.isfinite(least) else -np.inf


def _gap(robot: Robot, gait: Gait) -> float:
    """Returns the smallest gap along x between the ranges of neighbouring feet of a side [m]."""
    feet = LegSolver(robot).forward(robot.stance)[:, 0]
    needed = robot.gait.stride * gait.duty + APART * robot.foot.radius
    return float(min(np.abs(np.diff(feet[:3])).min(), np.abs(np.diff(feet[3:])).min()) - needed)


def _lifts(robot: Robot, gait: Gait) -> bool:
    """Returns whether the joints can lift each foot anywhere on its way (`StanceLoads`)."""
    legs = LegSolver(robot)
    home, way = legs.forward(robot.stance), RESERVE * robot.gait.stride * gait.duty
    along = way * np.array([[-0.5], [0.0], [0.5]])
    plane = np.asarray(home[:, 0] + 1j * home[:, 1] + along, dtype=np.complex128)
    pose = legs.pose(plane, home[:, 2] + LIFTED * gait.step_height + np.zeros((3, 1)))
    return not legs.solve(pose, np.zeros_like(plane), np.zeros(plane.shape)).unreachable.any()


def _stride_command(robot: Robot, gait: Gait) -> BodyCommand:
    """Returns the command at which a body moves by its stride, with a reserve, in a period."""
    return BodyCommand(vx=RESERVE * robot.gait.stride / gait.period)


@dataclass(frozen=True)
class Motion:
    """What a settled walk needs of the joints."""

    speed: float  # rad/s    largest of a joint; infinite where a standing leg does not reach
    cut: bool  # a swinging foot cannot follow its whole arc


def settled_motion(robot: Robot, gait: Gait, command: BodyCommand) -> Motion:
    """Returns what a settled walk under a command needs of the joints, if no limit of their speed
    slows the body (C59). A speed above the limit counts as the limit.
    """
    period = gait.period / STEPS
    free = replace(robot, servo=replace(robot.servo, speed_max=UNLIMITED))
    controller = Controller(free, period=period, gait=gait)
    measured, largest, shown = Measurement(), 0.0, controller.diagnostics
    cut = False
    for step in range(3 * STEPS):
        speed = controller.step(step * period, command, measured).speed_ref
        if (shown.unreachable & ~shown.swinging).any():
            return Motion(float("inf"), cut=True)
        if step >= 2 * STEPS:
            largest = max(largest, float(np.abs(speed).max()))
            cut = cut or bool(shown.unreachable.any())
    return Motion(min(largest, robot.servo.speed_max), cut)
