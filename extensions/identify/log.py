"""Reads the log of a robot: commands, and readings of any sensors, over time.

A log is a CSV, Parquet or MCAP file whose columns have the names of the FMU's variables. It needs
the commanded angle of every joint; all else is optional. The attitude is compared as roll, pitch
and yaw, which are made from a quaternion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from hexapod_cosim.cosim.interface.names import (
    foot_names,
    foot_vector_names,
    joint_names,
    vector_names,
)
from hexapod_cosim.cosim.logs.mcap_reader import read_mcap
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.columns import known_columns, plant_variables
from hexapod_cosim.cosim.results.recordings import read_csv, read_parquet
from hexapod_cosim.models import HexapodError, Robot
from hexapod_cosim.models.arrays import Array

LEAST_ROWS = 10
HELD_OUT = 0.25  # share of each log at its end that a fit does not see
LONGEST_STEP = 0.2  # s    between two rows
LARGEST = 2.0 * np.pi  # rad  of a command; a larger one is not in rad
ATTITUDE = ("torso.roll", "torso.pitch", "torso.yaw")
QUATERNIONS = ("torso.quaternion", "imu.quaternion")  # the first one that a log has counts


class LogError(HexapodError):
    """A log cannot be used."""


@dataclass(frozen=True)
class Channel:
    """Describes the readings of one kind: key, title, unit, sensors and names of the columns.

    Readings of the same sensors are late by the same delay.
    """

    key: str
    title: str
    unit: str
    sensors: str
    names: tuple[str, ...]


CHANNELS = (
    Channel("angle", "Joint angles", "rad", "joints", tuple(joint_names("angle"))),
    Channel("speed", "Joint speeds", "rad/s", "joints", tuple(joint_names("speed"))),
    Channel("torque", "Servo torques", "N.m", "currents", tuple(joint_names("torque"))),
    Channel("current", "Servo currents", "A", "currents", tuple(joint_names("current"))),
    Channel(
        "normal_force", "Normal forces of feet", "N", "forces", tuple(foot_names("normal_force"))
    ),
    Channel("force", "Forces of feet", "N", "forces", tuple(foot_vector_names("force"))),
    Channel("gyroscope", "Gyroscope", "rad/s", "imu", tuple(vector_names("imu.angular_velocity"))),
    Channel(
        "accelerometer", "Accelerometer", "m/s2", "imu", tuple(vector_names("imu.specific_force"))
    ),
    Channel(
        "position", "Position of the torso", "m", "pose", tuple(vector_names("torso.position"))
    ),
    Channel("attitude", "Attitude of the torso", "rad", "pose", ATTITUDE),
)
SENSORS = tuple(dict.fromkeys(channel.sensors for channel in CHANNELS))
COMMANDS = tuple(joint_names("angle_ref"))


@cache
def channel_of(name: str) -> Channel:
    """Returns the channel of a column."""
    return next(channel for channel in CHANNELS if name in channel.names)


@dataclass(frozen=True)
class Log:
    """Rows of a log.

    The commands of row k hold from time[k] to time[k + 1]; its readings are of time[k].
    """

    recording: Recording  # time, commands and known readings
    where: str
    warnings: tuple[str, ...] = ()  # what a user must know of the columns, as sentences

    @property
    def time(self) -> Array:
        """Returns the times (rows,) [s]."""
        return self.recording.time

    @property
    def commands(self) -> Mapping[str, Array]:
        """Returns the plant's inputs in the log, by name, each (rows,)."""
        have = set(self.recording.names)
        return {name: self.recording.column(name) for name in input_names() if name in have}

    def names(self, channel: Channel) -> tuple[str, ...]:
        """Returns the columns of a channel that the log has."""
        have = set(self.recording.names)
        return tuple(name for name in channel.names if name in have)

    @property
    def measured(self) -> tuple[str, ...]:
        """Returns the columns of all readings."""
        return tuple(name for channel in CHANNELS for name in self.names(channel))

    def has(self, names: Sequence[str]) -> bool:
        """Returns whether the log has all these columns."""
        return set(names) <= set(self.recording.names)

    def part(self, rows: slice) -> Log:
        """Returns some rows of the log."""
        return replace(self, recording=self.recording.rows(rows))

    def without(self, names: Sequence[str]) -> Log:
        """Returns the log without some columns."""
        keep = [k for k, name in enumerate(self.recording.names) if name not in names]
        kept = tuple(self.recording.names[k] for k in keep)
        return replace(self, recording=Recording(kept, self.recording.data[:, keep]))


@cache
def input_names() -> tuple[str, ...]:
    """Returns the plant's inputs, which a log's commands are."""
    return tuple(plant_variables("input"))


def read_log(path: Path, *, robot: Robot | None = None) -> Log:
    """Reads a log and checks its times and commands.

    robot: whose log it is, for the joints and transforms of an MCAP file.

    Raises LogError for a file of another kind and for unusable rows, HexapodError for one that is
    missing or damaged.
    """
    readers: dict[str, Callable[[], Recording]] = {
        ".csv": lambda: read_csv(path),
        ".parquet": lambda: read_parquet(path),
        ".mcap": lambda: read_mcap(path, robot=robot),
    }
    if path.suffix.lower() not in readers:
        expected = "a file that ends in " + ", ".join(readers)
        fix = "name the log's file, not its folder" if path.is_dir() else "convert it"
        raise LogError("not a log", got=path.name, expected=expected, fix=fix, where=str(path))
    if not path.exists():
        raise LogError(
            "no recording of a robot",
            got=f"{path.name}, which does not exist",
            expected="a file with commands and readings",
            fix="name your robot's log; without a robot, `python examples/05_robot_log.py "
            f"{path.with_suffix('.mcap').as_posix()}` writes that of a simulated one",
            where=str(path),
        )
    return log_of(readers[path.suffix.lower()](), str(path))


def log_of(recording: Recording, where: str) -> Log:
    """Returns the log that a recording holds: its commands and known readings. Raises LogError."""
    missing = [name for name in COMMANDS if name not in recording.names]
    if missing:
        raise LogError(
            "a log without commands",
            got=f"no column {missing[0]!r}"
            + (f" and {len(missing) - 1} more" * (len(missing) > 1)),
            expected="the commanded angles of all 18 joints",
            fix="name the columns as the FMU's inputs: LF.coxa.angle_ref [rad], ...",
            where=where,
        )
    _check_times(recording.time, where)
    known = _with_attitude(recording)
    wanted = {*input_names(), *(name for one in CHANNELS for name in one.names)}
    wanted |= {*vector_names("torso.velocity"), *vector_names("torso.angular_velocity")}
    valid = known_columns().keys() | wanted
    unknown = [name for name in recording.names if name not in valid]
    left_out = f"Columns of {where} with unknown names are left out: {', '.join(unknown)}."
    keep = [0, *(k for k, name in enumerate(known.names) if name in wanted)]
    kept = Recording(tuple(known.names[k] for k in keep), known.data[:, keep])
    log = Log(kept, where, (left_out,) if unknown else ())
    _check_commands(log)
    return log


def _check_commands(log: Log) -> None:
    for name, values in log.commands.items():
        known = np.isfinite(values)
        if not known.all():
            what, expected = "a command is not a number", "a number in each row"
            got = f"{name} at {log.time[~known][0]:g} s"
            fix = "drop these rows or repeat the command before"
            raise LogError(what, got=got, expected=expected, fix=fix, where=log.where)
        if name in COMMANDS and np.abs(values).max() > LARGEST:
            what, expected = "a command beyond a turn", "an angle in rad"
            got = f"{name} up to {np.abs(values).max():.3g}"
            fix = "convert degrees where the log is written"
            raise LogError(what, got=got, expected=expected, fix=fix, where=log.where)


def _check_times(time: Array, where: str) -> None:
    steps = np.diff(time)
    if len(time) < LEAST_ROWS:
        got, expected, fix = f"{len(time)} rows", f"{LEAST_ROWS} at least", "record a longer one"
        raise LogError("a log that is too short", got=got, expected=expected, fix=fix, where=where)
    bad = ~((steps > 0.0) & (steps <= LONGEST_STEP))
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        got = f"{steps[k]:g} s from row {k} to row {k + 1}"
        expected = f"increasing times in seconds, at most {LONGEST_STEP} s apart"
        fix = "divide milliseconds by 1000, sort the rows, or cut the log at the gap"
        raise LogError("times of a log", got=got, expected=expected, fix=fix, where=where)


def _with_attitude(recording: Recording) -> Recording:
    """Returns the recording with roll, pitch and yaw, if it has a quaternion and lacks them."""
    have = set(recording.names)
    if set(ATTITUDE) <= have:
        return recording
    for stem in QUATERNIONS:
        names = vector_names(stem, 4)
        if set(names) <= have:
            data = np.column_stack([recording.data, roll_pitch_yaw(recording.columns(names))])
            return Recording((*recording.names, *ATTITUDE), data)
    return recording


def roll_pitch_yaw(quaternions: Array) -> Array:
    """Returns the z-y-x angles (rows, 3) [rad] of quaternions (rows, 4); the yaw is continuous."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return np.column_stack([roll, pitch, yaw])


def without_readings(log: Log) -> LogError:
    """Returns the error for a log that has no readings which the plant predicts."""
    return LogError(
        "a log without readings",
        got="commands alone",
        expected="joint angles, torques, foot forces, an IMU or a pose",
        fix="name the columns as the FMU's outputs: LF.coxa.angle [rad], ...",
        where=log.where,
    )


def with_speed_references(log: Log, robot: Robot) -> Log:
    """Returns the log with the rates of its angle commands as the speed commands that it lacks.

    A servo's law has kd times the commanded less the measured speed (eq. 12). With a speed command
    of 0 kd would brake each motion, and the fit would make up for it with masses and gains far off.
    A log of servos without kd, whose law has no speed command, is returned as it is.
    """
    pairs = zip(joint_names("speed_ref"), COMMANDS, strict=True)
    missing = {name: angle for name, angle in pairs if not log.has([name])}
    if not missing or robot.servo.kd == 0.0:
        return log
    rates = [np.gradient(log.recording.column(angle), log.time) for angle in missing.values()]
    data = np.column_stack([log.recording.data, *rates])
    some = "" if len(missing) == len(COMMANDS) else f" of {len(missing)} joints"
    note = (
        f"{log.where} has no speed commands{some} ({next(iter(missing))} [rad/s], ...), which the "
        "servo's kd needs: the rates of the commanded angles are taken. Give the columns; 0 in "
        "each row is right where the servo damps the measured speed alone."
    )
    recording = Recording((*log.recording.names, *missing), data)
    return replace(log, recording=recording, warnings=(*log.warnings, note))
