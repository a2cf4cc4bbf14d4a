"""Finds columns of commands that cannot be what the servos got.

A wrong command moves the whole simulated robot, so that good readings look wrong. It is therefore
found without a simulation: a servo's measured angle follows its command, late by some hundredths of
a second. Where command and angle of a joint contradict each other, a third column tells which of
them is wrong: the measured speed, whose integral is the angle, the torque, which is about
proportional to command less angle, or the commanded speed. Without any of these the reading is
screened as all are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.extensions.identify.log import Log, LogError
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
# Loads bend a joint: one that moves by less than this need not follow its command. A constant
# command is wrong also where its joint moves by more than BENDING times what the same joint of the
# other legs differs from its command, if its torque does not say that a load bends it.
LEAST_MOTION = 0.15  # rad
BENDING = 2.0
# two commands are exchanged where the mean squares of command less angle fall by this factor
NEARER = 4.0


class WrongCommandsError(LogError):
    """Columns of commands that cannot be what the servos got."""

    columns: tuple[BadColumn, ...] = ()


def check_commands(log: Log) -> None:
    """Raises WrongCommandsError for a log with commands that the servos cannot have got."""
    bad = wrong_commands(log)
    if bad:
        raise wrong_commands_error(log, bad)


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
    """Returns the columns of commanded angles and speeds that the servos cannot have got."""
    names = [name.removesuffix(".angle") for name in joint_names("angle")]
    joints = [_Joint(log, name) for name in names]
    found = []
    for one in joints:
        why = (
            one.dead(_least_motion(one, joints))
            or _exchanged(one, joints)
            or one.turned()
            or one.astray(joints)
        )
        if why:
            found.append(BadColumn(f"{one.name}.angle_ref", why))
    wrong = {column.name for column in found}
    return found + _wrong_speeds(
        [one for one in joints if f"{one.name}.angle_ref" not in wrong], log.time
    )


class _Joint:
    """Columns of a joint; None where the log lacks one."""

    def __init__(self, log: Log, name: str) -> None:
        self.name, self.time = name, log.time
        self.command = log.recording.column(f"{name}.angle_ref")
        self.angle = _optional(log, f"{name}.angle")
        self.torque = _optional(log, f"{name}.torque", f"{name}.current")
        self.speed_ref = _optional(log, f"{name}.speed_ref")
        self._speed = _optional(log, f"{name}.speed")
        self.follows = float("nan") if self.angle is None else correlation(self.angle, self.command)
        self.moves = self.angle is not None and _range(self.angle) > LEAST_MOTION

    def dead(self, least: float) -> str | None:
        """Returns why the command does not come from the robot's control; None if it may.

        least: by how much loads may bend the joint [rad].
        """
        largest = float(np.max(np.abs(self.command)))
        if largest > TURN:
            return f"not in rad: {largest:.3g} is more than a turn"
        if self.angle is None:
            return None
        begin, end = longest_run(self.command)
        run = slice(begin, end)
        moved = _range(self.angle[run])
        if end - begin <= LONGEST_STUCK * len(self.command) or moved <= MOVES * _range(self.angle):
            return None
        if moved <= least or (moved <= LEAST_MOTION and self._is_bent(run)):
            return None
        value = f"{self.command[begin]:g}"
        if end - begin == len(self.command):
            return f"dead: {value} in every row, while {self.name}.angle moves by {moved:.2g} rad"
        span = f"{self.time[begin]:.3g} s to {self.time[end - 1]:.3g} s"
        return f"stuck at {value} from {span}, while {self.name}.angle moves by {moved:.2g} rad"

    def _is_bent(self, run: slice) -> bool:
        """Returns whether the torque may have moved the joint in rows with a constant command: a
        servo's torque is about proportional to command less angle.
        """
        if self.angle is None or self.torque is None:
            return True
        return correlation(self.torque[run], -self.angle[run]) > FOLLOWS

    def turned(self) -> str | None:
        """Returns why the command has the wrong sign or unit; None if it has not."""
        if self.angle is None or not self.moves:
            return None
        if self.follows < AGAINST and self.is_right(self.angle, -self.command, -self.angle):
            return f"wrong sign: its correlation with {self.name}.angle is {self.follows:.2f}"
        scale = float(np.std(self.command) / np.std(self.angle))
        if abs(self.follows) > FOLLOWS and DEGREES[0] < scale < DEGREES[1]:
            return f"in degrees: {scale:.0f} times {self.name}.angle"
        return None

    def astray(self, joints: Sequence[_Joint]) -> str | None:
        """Returns why the joint does not follow its command while others do; None if it does."""
        others = [one.follows for one in joints if one is not self and np.isfinite(one.follows)]
        if self.angle is None or not others or np.median(others) <= FOLLOWS:
            return None
        if _range(self.angle) <= LEAST_MOTION:
            return None
        weak = not self.follows > WEAK
        if not weak or not self.is_right(self.angle, None, None):
            return None
        return (
            f"{self.name}.angle does not follow it: their correlation is {self.follows:.2f}, that "
            f"of other joints {np.median(others):.2f}"
        )

    def is_right(self, angle: Array, command: Array | None, other: Array | None) -> bool:
        """Returns whether a third column says that the angle is right and the command wrong.

        command: what it would be; other: what the angle would be if the command were right; None:
        unknown.
        """
        if self._speed is not None:
            return self._is_nearer(angle, self._speed)
        if self.torque is not None and command is not None and other is not None:
            wrong = correlation(self.torque, command - angle)
            return wrong > max(WEAK, correlation(self.torque, self.command - other))
        if self.speed_ref is not None and np.ptp(self.speed_ref) > 0.0:
            return self._is_nearer(angle, self.speed_ref)
        return False

    def _is_nearer(self, angle: Array, speed: Array) -> bool:
        """Returns whether the integral of a speed follows the angle, and more than the command."""
        way = _integral(speed, self.time)
        return _aligned(angle, way, self.time) > max(
            FOLLOWS, _aligned(self.command, way, self.time)
        )


def _least_motion(one: _Joint, joints: Sequence[_Joint]) -> float:
    """Returns by how much loads may bend a joint, from the same joint of the other legs [rad]."""
    kind = one.name.rpartition(".")[2]  # coxa, femur or tibia
    ranges = [
        _range(other.command - other.angle)
        for other in joints
        if other is not one and other.name.endswith(kind) and other.angle is not None
    ]
    if not ranges:
        return LEAST_MOTION
    return min(LEAST_MOTION, BENDING * float(np.median(ranges)))


def _exchanged(one: _Joint, joints: Sequence[_Joint]) -> str | None:
    """Returns that two joints have each other's command; None if not."""
    if one.angle is None or not one.moves:
        return None
    for other in joints:
        if other is one or other.angle is None or not other.moves:
            continue
        own = _unlike(one.angle, one.command), _unlike(other.angle, other.command)
        across = _unlike(one.angle, other.command), _unlike(other.angle, one.command)
        nearer = own[0] > NEARER * across[0] and own[1] > NEARER * across[1]
        if nearer and one.is_right(one.angle, other.command, other.angle):
            return f"exchanged with {other.name}.angle_ref: each joint follows the other's command"
    return None


def _wrong_speeds(joints: Sequence[_Joint], time: Array) -> list[BadColumn]:
    """Returns the commanded speeds that are not those of the commanded angles, if most are."""
    columns = {}
    for one in joints:
        if one.speed_ref is not None and _range(one.command) > LEAST_MOTION:
            rate = np.gradient(one.command, time)
            spread = float(np.std(rate))
            scale = float(np.std(one.speed_ref)) / spread if spread > 0.0 else 1.0
            dead = np.ptp(one.speed_ref) == 0.0
            follows = float("nan") if dead else correlation(one.speed_ref, rate)
            columns[f"{one.name}.speed_ref"] = follows, scale
    typical = np.median([np.nan_to_num(follows) for follows, _ in columns.values()] or [0.0])
    if typical <= FOLLOWS:
        return []
    found = []
    for name, (follows, scale) in columns.items():
        stem = name.removesuffix(".speed_ref")
        if not np.isfinite(follows):
            found.append(BadColumn(name, f"dead, while {stem}.angle_ref moves"))
        elif follows < WEAK:
            text = f"it is not the rate of {stem}.angle_ref: their correlation is {follows:.2f}"
            found.append(BadColumn(name, text))
        elif DEGREES[0] < scale < DEGREES[1]:
            found.append(BadColumn(name, f"in degrees: {scale:.0f} times the rate of the angle"))
    return found


def _optional(log: Log, *names: str) -> Array | None:
    """Returns the first of some columns that the log has, without gaps; None if it has none."""
    for name in names:
        if log.has([name]):
            values = log.recording.column(name)
            known = np.isfinite(values)
            if np.sum(known) > 1:
                return np.interp(log.time, log.time[known], values[known])
    return None


def _range(values: Array) -> float:
    """Returns the range of values without a hundredth at each end."""
    low, high = np.quantile(values, [0.01, 0.99])
    return float(high - low)


def _integral(speed: Array, time: Array) -> Array:
    """Returns the integral of a speed (rows,)."""
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _aligned(values: Array, way: Array, time: Array) -> float:
    """Returns the correlation of two columns without their straight lines."""
    both = np.column_stack([values, way])
    line = np.polynomial.polynomial.polyfit(time - time[0], both, 1)
    flat = both - np.polynomial.polynomial.polyval(time - time[0], line).T
    return correlation(flat[:, 0], flat[:, 1])


def _unlike(angle: Array, command: Array) -> float:
    """Returns the mean square of the differences between an angle and a command [rad2]."""
    return float(np.mean((angle - command) ** 2))
