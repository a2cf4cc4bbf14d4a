"""Checks before a run, by inverse kinematics, that the legs reach what a scenario commands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, fields
from functools import lru_cache

import numpy as np

from hexapod_cosim.controller import BodyCommand, Controller, Gait
from hexapod_cosim.controller.plane import LEGS, cis
from hexapod_cosim.controller.planned_step import place_legs
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.controller.walk.swing import Twist, travel
from hexapod_cosim.cosim.scenario.records import Command
from hexapod_cosim.models import Robot, ScenarioError
from hexapod_cosim.models.arrays import Array

NAMES = tuple(item.name for item in fields(BodyCommand))
UNITS = ("m/s", "m/s", "rad/s", "m", "rad", "rad")
MOTION = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)  # selects the velocities; the other entries are posture
STEPS_PER_CYCLE = 50  # in a gait period that are looked at: enough to see every phase
MOST_STEPS = 1000  # of a gait whose feet stand or swing for less than 0.4 % of the period
RESOLUTION = 0.005  # relative, of the limit in the message


def check_commands(commands: Sequence[Command], robot: Robot, gait: Gait, *, where: str) -> None:
    """Checks that standing feet stay within reach under each command's strides and posture.

    A foot out of reach in the air only shortens the arc of its step, and is allowed. Raises
    ScenarioError, which names the largest command that the legs can follow.
    """
    for command in commands:
        values = astuple(command)[1:]
        if not _walks_cached(values, robot, gait):
            wanted = np.array(values)
            place = f"{where} at time = {command.time:g} s" if len(commands) > 1 else where
            raise _reach_error(wanted, robot, gait, place)


def reaches(commands: Sequence[Command], robot: Robot, gait: Gait) -> bool:
    """Returns whether check_commands() accepts the commands."""
    return all(_walks_cached(astuple(command)[1:], robot, gait) for command in commands)


@lru_cache(maxsize=256)
def _walks_cached(values: tuple[float, ...], robot: Robot, gait: Gait) -> bool:
    """Returns `_walks` of a command's values from a cache: runs of a study share commands."""
    return _walks(np.array(values), robot, gait)


@np.errstate(over="ignore", invalid="ignore")
def _walks(values: Array, robot: Robot, gait: Gait) -> bool:
    """Whether all standing feet are within reach throughout a settled cycle of the command (6,).

    A foot stands under its stance position half-way through its stance (C4); before and after that
    it is where the motion of the body over the ground puts it (C3, C5).
    """
    least = min(gait.duty, 1.0 - gait.duty)
    count = max(STEPS_PER_CYCLE, math.ceil(min(4.0 / least, MOST_STEPS)))
    controller = Controller(robot, period=gait.period / count, gait=gait)
    paths = controller.plan.paths
    clock = paths.clock.offset + np.arange(count)[:, None] / count  # cycles    (count, 6)
    phase = clock - np.floor(clock)
    time = gait.period * (phase - 0.5 * gait.duty)  # s    since half-way
    vx, vy, yaw_rate = values[:3].tolist()
    way = travel(Twist(complex(vx, vy), yaw_rate), time)
    plane = cis(-yaw_rate * time) * (paths.home - way)
    height = np.broadcast_to(paths.home_height, plane.shape)
    posture = Posture.of(values[3:], np.zeros(3))
    _, pose = place_legs(controller.legs, posture, plane, height, np.zeros(LEGS))
    still = np.zeros_like(plane)
    unreachable = controller.legs.solve(pose, still, still.real).unreachable
    return not (unreachable & (phase < gait.duty)).any()


def _reach_error(wanted: Array, robot: Robot, gait: Gait, where: str) -> ScenarioError:
    """Returns the error for a command (6,), with the largest share of it that can be followed."""
    motion = wanted * MOTION
    posture = wanted - motion
    if _walks(posture, robot, gait):
        limit = posture + motion * largest_share(motion, posture, robot, gait)
        what, shown = "the legs do not reach the strides of this command", motion != 0.0
        fix = "slow the command down, or shorten gait.period"
    else:
        limit = wanted * largest_share(posture, np.zeros(6), robot, gait)
        what, shown = "the legs do not reach this posture", posture != 0.0
        fix = "move the body less"
    expected = (
        f"at most {_text(limit, shown)} with gait {gait.name}, "
        f"period {gait.period:g} s and duty factor {gait.duty:.3g}"
    )
    return ScenarioError(what, got=_text(wanted, shown), expected=expected, fix=fix, where=where)


def largest_share(part: Array, rest: Array, robot: Robot, gait: Gait) -> float:
    """Returns, by bisection, the largest share of `part` that the legs follow on top of `rest`.

    Both are commands (6,) in SI units; the share is at most 1.
    """
    low, high = 0.0, 1.0
    while high - low > RESOLUTION * high:
        middle = 0.5 * (low + high) if low > 0.0 else 0.1 * high
        if _walks(rest + middle * part, robot, gait):
            low = middle
        else:
            high = middle
    return (1.0 - RESOLUTION) * low


def _text(values: Array, shown: Array) -> str:
    """Returns the selected entries of a command (6,) with names and units."""
    entries = zip(NAMES, values.tolist(), UNITS, shown.tolist(), strict=True)
    return " and ".join(
        f"{name} = {value:.3g} {unit}" for name, value, unit, chosen in entries if chosen
    )
