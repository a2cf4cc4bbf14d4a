"""Finds columns of commands that cannot be what the servos got.

A wrong command moves the whole simulated robot, so that good readings look wrong. It is therefore
found without a simulation: a servo's measured angle follows its command. Where both contradict each
other, the measured speed says which of them is wrong: its integral is the angle. Without measured
speeds the angle is screened as all readings are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.log import COMMANDS, Log, LogError
from hexapod_cosim.extensions.identify.screening import (
    AGAINST,
    DEGREES,
    FOLLOWS,
    LONGEST_STUCK,
    MOVES,
    WEAK,
    BadColumn,
    correlation,
    longest_run,
)
from hexapod_cosim.extensions.identify.start import TURN

Array = NDArray[np.float64]
LEAST_MOTION = 0.15  # rad    loads may bend a joint by less, whatever its command


class WrongCommandsError(LogError):
    """Columns of commands that cannot be what the servos got."""

    columns: tuple[BadColumn, ...] = ()


def wrong_commands_error(log: Log, bad: Sequence[BadColumn]) -> WrongCommandsError:
    """Returns the error for a log with wrong commands, which are given."""
    more = f", and {', '.join(one.name for one in bad[1:])}" if len(bad) > 1 else ""
    error = WrongCommandsError(
        "the robot cannot have got the commands of the log",
        got=f"{bad[0].name}: {bad[0].why}{more}",
        expected="commands that the joints follow",
        fix="correct name, unit or sign of the column where the log is written, or cut the log to "
        "the rows where it is right; without its commands a robot cannot be simulated",
        where=log.where,
    )
    error.columns = tuple(bad)
    return error


def wrong_commands(log: Log) -> list[BadColumn]:
    """Returns the columns of commanded angles that the servos cannot have got."""
    found = []
    for name in COMMANDS:
        command = log.recording.column(name)
        largest = float(np.max(np.abs(command)))
        angle = _optional(log, name.replace(".angle_ref", ".angle"))
        why = f"not in rad: {largest:.3g} is more than a turn" if largest > TURN else None
        if why is None and angle is not None and _range(angle) > LEAST_MOTION:
            speed = _optional(log, name.replace(".angle_ref", ".speed"))
            why = _constant(command, angle, log.time) or _turned(command, angle, speed, log.time)
        if why:
            found.append(BadColumn(name, why))
    return found


def _constant(command: Array, angle: Array, time: Array) -> str | None:
    """Returns that a command is constant while its joint moves; None if it is not."""
    begin, end = longest_run(command)
    moved = _range(angle[begin:end])
    few = end - begin <= LONGEST_STUCK * len(command)
    if few or moved <= max(LEAST_MOTION, MOVES * _range(angle)):
        return None
    value, moves = f"{command[begin]:g}", f"while the joint moves by {moved:.2g} rad"
    if end - begin == len(command):
        return f"dead: {value} in every row, {moves}"
    return f"stuck at {value} from {time[begin]:.3g} s to {time[end - 1]:.3g} s, {moves}"


def _turned(command: Array, angle: Array, speed: Array | None, time: Array) -> str | None:
    """Returns why a command has the wrong unit or sign, or is another joint's; None if not."""
    follows, scale = correlation(angle, command), float(np.std(command) / np.std(angle))
    if abs(follows) > FOLLOWS and DEGREES[0] < scale < DEGREES[1]:
        return f"in degrees: {scale:.0f} times the measured angle"
    if follows > WEAK or speed is None or not _is_rate(speed, angle, command, time):
        return None
    kind = "wrong sign" if follows < AGAINST else "the joint does not follow it"
    return f"{kind}: its correlation with the measured angle is {follows:.2f}"


def _is_rate(speed: Array, angle: Array, command: Array, time: Array) -> bool:
    """Returns whether a speed is the rate of the angle, and less that of the command."""
    rate, other = np.gradient(angle, time), np.gradient(command, time)
    return correlation(speed, rate) > max(WEAK, correlation(speed, other))


def _optional(log: Log, name: str) -> Array | None:
    """Returns a column without gaps; None where the log lacks it."""
    if not log.has([name]):
        return None
    values = log.recording.column(name)
    known = np.isfinite(values)
    return np.interp(log.time, log.time[known], values[known]) if np.sum(known) > 1 else None


def _range(values: Array) -> float:
    """Returns the range of values without a hundredth at each end."""
    low, high = np.quantile(values, [0.01, 0.99])
    return float(high - low)
