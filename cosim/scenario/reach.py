"""Can the legs walk what a scenario commands? Tried on the controller itself, before the run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, fields
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, Controller, Gait, Measurement
from hexapod_cosim.cosim.scenario.records import Command
from hexapod_cosim.models import Robot, ScenarioError

Array = NDArray[np.float64]

NAMES = tuple(item.name for item in fields(BodyCommand))
UNITS = ("m/s", "m/s", "rad/s", "m", "rad", "rad")
MOTION = (
    1.0,
    1.0,
    1.0,
    0.0,
    0.0,
    0.0,
)  # which of them move the body on; the others are its posture
TRIED_STEPS = 50  # of the controller in a gait period: enough to see every phase
SETTLING_CYCLES = 2  # one to ramp the command up, one until every foot has landed under it
RESOLUTION = 0.005  # relative, of the limit that is told


def check_commands(commands: Sequence[Command], robot: Robot, gait: Gait, *, where: str) -> None:
    """Raises ScenarioError for a command that needs strides, or a posture, with standing feet
    beyond their legs' reach.

    A foot beyond reach only in the air shortens the step's arc, not the walk, and is let pass.
    """
    for command in commands:
        wanted = np.array(astuple(command)[1:])
        if not _walks_once(tuple(wanted.tolist()), robot, gait):
            raise _refusal(
                wanted,
                robot,
                gait,
                f"{where} at time = {command.time:g} s" if len(commands) > 1 else where,
            )


@lru_cache(maxsize=256)
def _walks_once(values: tuple[float, ...], robot: Robot, gait: Gait) -> bool:
    """`_walks`, remembered."""
    return _walks(np.array(values), robot, gait)


@np.errstate(over="ignore", invalid="ignore")
def _walks(values: Array, robot: Robot, gait: Gait) -> bool:
    """Whether all standing feet are within reach throughout a settled cycle of the command (6,)."""
    count = max(TRIED_STEPS, math.ceil(4.0 / min(gait.duty, 1.0 - gait.duty)))
    period = gait.period / count
    controller, measurement, command = (
        Controller(robot, period=period, gait=gait),
        Measurement(),
        BodyCommand(*values.tolist()),
    )
    diagnostics = controller.diagnostics
    for k in range((SETTLING_CYCLES + 1) * count):
        controller.step(k * period, command, measurement)
        if k >= SETTLING_CYCLES * count and (diagnostics.unreachable & ~diagnostics.swinging).any():
            return False
    return True


def _refusal(wanted: Array, robot: Robot, gait: Gait, where: str) -> ScenarioError:
    motion = wanted * MOTION
    if _walks(wanted - motion, robot, gait):
        limit = wanted - motion + motion * _largest_share(motion, wanted - motion, robot, gait)
        what, shown = "the legs do not reach the strides of this command", motion != 0.0
        fix = "slow the command down, or shorten gait.period"
    else:
        limit = wanted * _largest_share(wanted - motion, np.zeros(6), robot, gait)
        what, shown, fix = (
            "the legs do not reach this posture",
            (wanted - motion) != 0.0,
            "move the body less",
        )
    expected = f"at most {_text(limit, shown)} with gait {gait.name}, period {gait.period:g} s and duty factor {gait.duty:.3g}"
    return ScenarioError(what, got=_text(wanted, shown), expected=expected, fix=fix, where=where)


def _largest_share(part: Array, rest: Array, robot: Robot, gait: Gait) -> float:
    """How much of `part`, on top of `rest`, the legs can follow; rounded down."""
    low, high = 0.0, 1.0
    while high - low > RESOLUTION * high:
        middle = 0.5 * (low + high) if low > 0.0 else 0.1 * high
        if _walks(rest + middle * part, robot, gait):
            low = middle
        else:
            high = middle
    return (1.0 - RESOLUTION) * low


def _text(values: Array, shown: Array) -> str:
    entries = zip(NAMES, values.tolist(), UNITS, shown.tolist(), strict=True)
    return " and ".join(
        f"{name} = {value:.3g} {unit}" for name, value, unit, chosen in entries if chosen
    )
