"""Makes motion, motor torques and foot forces of a log, as the inverse dynamics takes them.

Readings of the log are interpolated to equal times and smoothed without a shift in time.
Accelerations are central differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import (
    foot_names,
    foot_vector_names,
    joint_names,
    vector_names,
)
from hexapod_cosim.extensions.identify.log import ATTITUDE, Log
from hexapod_cosim.extensions.identify.rigid.regressor import Motion
from hexapod_cosim.extensions.identify.start import rest_rows
from hexapod_cosim.extensions.identify.unknowns import BIAS
from hexapod_cosim.models import LEG_NAMES, Robot

Array = NDArray[np.float64]
SMOOTH = 40.0  # Hz    cut-off of the readings: beyond it encoders have noise alone
LEAST_RATE = 2.5  # cut-offs: rows below this rate are not smoothed
IN_AIR = 0.15  # of the rows: each foot of a walk is in the air for longer
LEAST_IN_AIR = 10  # rows
LARGEST_BIAS = 0.3  # of the force of a foot of the standing robot


@dataclass(frozen=True)
class Samples:
    """Readings of a log at equal times."""

    period: float  # s
    motion: Motion
    motor: Array  # (samples, 6, 3)  torque [N m], or current [A]
    is_current: bool
    force: Array  # (samples, 6, 3)  of the ground on the feet, world axes [N]
    tangential: bool  # whether the force has its parts along the ground
    error: Array  # (samples, 6, 3)  commanded less measured angle [rad]
    speed_error: Array  # (samples, 6, 3) [rad/s]
    torque_ref: Array  # (samples, 6, 3) N m
    biases: dict[str, float]  # of IMU and forces, by the key of the table of unknowns


def lacking(log: Log) -> str:
    """Returns what a log lacks for its inverse dynamics, as words; empty if nothing."""
    needs = {
        "joint angles": log.has(joint_names("angle")),
        "torques or currents": log.has(joint_names("torque")) or log.has(joint_names("current")),
        "forces of the feet": log.has(foot_names("normal_force"))
        or log.has(foot_vector_names("force")),
        "the attitude": log.has(ATTITUDE),
        "an IMU": log.has(vector_names("imu.angular_velocity"))
        and log.has(vector_names("imu.specific_force")),
    }
    return ", ".join(name for name, there in needs.items() if not there)


class _Reader:
    """Reads columns of a log at equal times."""

    def __init__(self, log: Log, rows: slice) -> None:
        part = log.part(rows)
        self.log, self._time = part, part.time
        self.period = float(np.median(np.diff(self._time)))
        count = int((self._time[-1] - self._time[0]) / self.period + 1e-6) + 1
        self.time = self._time[0] + self.period * np.arange(count)

    def raw(self, names: list[str]) -> Array:
        """Returns readings (samples, names), without gaps."""
        columns = []
        for name in names:
            own = self.log.recording.column(name)
            known = np.isfinite(own)
            columns.append(np.interp(self.time, self._time[known], own[known]))
        return np.column_stack(columns)

    def smooth(self, names: list[str]) -> Array:
        """Returns smoothed readings (samples, names)."""
        return smoothed(self.raw(names), self.period)

    def held(self, names: list[str], shift: int) -> Array:
        """Returns commands (samples, names) as they held some rows before; 0 without them."""
        have = [name for name in names if self.log.has([name])]
        found = np.zeros((len(self.time), len(names)))
        place = np.searchsorted(self._time, self.time + 1e-9, side="right") - 1 - shift
        for name in have:
            found[:, names.index(name)] = self.log.recording.column(name)[np.maximum(place, 0)]
        return found


def smoothed(values: Array, period: float) -> Array:
    """Returns values (samples, columns) after a low-pass filter that does not shift them."""
    from scipy.signal import butter, sosfiltfilt  # noqa: PLC0415  slow to import

    if 1.0 / period < LEAST_RATE * SMOOTH:
        return values
    sections = butter(2, SMOOTH, fs=1.0 / period, output="sos")
    return np.asarray(sosfiltfilt(sections, values, axis=0))


def slope(values: Array, period: float) -> Array:
    """Returns central differences (samples, ...) by time."""
    return np.asarray(np.gradient(values, period, axis=0, edge_order=2))


def samples_of(log: Log, rows: slice, robot: Robot, *, shift: int) -> Samples:
    """Returns what a log tells of the inverse dynamics.

    Args:
        log: with all that `lacking` names.
        rows: which of it.
        robot: as the robot file has it; the IMU is at its centre of mass.
        shift: how many rows before a reading its command was sent.
    """
    reader = _Reader(log, rows)
    count, period = len(reader.time), reader.period
    angle = reader.smooth(joint_names("angle"))
    speeds = joint_names("speed")
    speed = reader.smooth(speeds) if log.has(speeds) else slope(angle, period)
    is_current = not log.has(joint_names("torque"))
    motor = reader.smooth(joint_names("current" if is_current else "torque"))
    turn = _turns(reader.smooth(list(ATTITUDE)))
    biases = imu_biases(log, robot) | force_biases(log, rows)
    spin = reader.smooth(vector_names("imu.angular_velocity"))
    spin = spin - [biases[f"{BIAS}{name}"] for name in vector_names("imu.angular_velocity")]
    specific = reader.smooth(vector_names("imu.specific_force"))
    specific = specific - [biases[f"{BIAS}{name}"] for name in vector_names("imu.specific_force")]
    rate = slope(spin, period)
    arm = np.broadcast_to(-np.array(robot.torso.com), spin.shape)
    lift = specific + np.cross(rate, arm) + np.cross(spin, np.cross(spin, arm))
    force, tangential = _forces(reader, biases)
    # references hold over a row and are compared with readings that are not smoothed
    error = reader.held(joint_names("angle_ref"), shift) - reader.raw(joint_names("angle"))
    speed_now = reader.raw(speeds) if log.has(speeds) else speed
    joints = (count, 6, 3)
    return Samples(
        period=period,
        motion=Motion(
            angle=angle.reshape(joints),
            speed=speed.reshape(joints),
            acceleration=slope(speed, period).reshape(joints),
            spin=spin,
            spin_rate=rate,
            lift=lift,
            turn=turn,
        ),
        motor=motor.reshape(joints),
        is_current=is_current,
        force=force,
        tangential=tangential,
        error=error.reshape(joints),
        speed_error=(reader.held(joint_names("speed_ref"), shift) - speed_now).reshape(joints),
        torque_ref=reader.held(joint_names("torque_ref"), shift).reshape(joints),
        biases=biases,
    )


def _forces(reader: _Reader, biases: dict[str, float]) -> tuple[Array, bool]:
    """Returns the forces of the feet (samples, 6, 3), and whether all their parts are known."""
    names = foot_vector_names("force")
    if reader.log.has(names):
        own = [biases[f"{BIAS}{name}"] for name in names]
        return (reader.smooth(names) - own).reshape(-1, 6, 3), True
    names = foot_names("normal_force")
    own = [biases[f"{BIAS}{name}"] for name in names]
    force = np.zeros((len(reader.time), 6, 3))
    force[:, :, 2] = reader.smooth(names) - own
    return force, False


def force_biases(log: Log, rows: slice) -> dict[str, float]:
    """Returns what the force sensors read of feet in the air; 0 of feet that are never there.

    Readings in the air are all alike, so that they are those in the shortest interval which has a
    given share of them. Rows in which the robot stands do not count. Keys are those of the table of
    unknowns.
    """
    begin, end, _ = rows.indices(len(log.time))
    rest = rest_rows(log)
    found = {}
    for leg in LEG_NAMES:
        vector = vector_names(f"{leg}.foot.force")
        names = vector if log.has(vector) else [f"{leg}.foot.normal_force"]
        if not log.has(names):
            continue
        table = log.recording.columns(names)
        load = float(np.nanmean(table[:rest, -1] if rest > 1 else table[:, -1]))
        own = _most_frequent(table[max(begin, rest) : end])
        there = own is not None and abs(own[-1]) < LARGEST_BIAS * abs(load)
        for k, name in enumerate(names):
            found[f"{BIAS}{name}"] = float(own[k]) if own is not None and there else 0.0
    return found


def _most_frequent(table: Array) -> Array | None:
    """Returns the means (columns,) of the rows in which the last column has its most frequent
    readings; None of few rows.
    """
    upward = table[:, -1]
    known = np.sort(upward[np.isfinite(upward)])
    share = int(IN_AIR * len(known))
    if share < LEAST_IN_AIR:
        return None
    first = int(np.argmin(known[share:] - known[:-share]))
    there = (upward >= known[first]) & (upward <= known[first + share])
    return np.asarray(np.nanmean(table[there], axis=0))


def _turns(angles: Array) -> Array:
    """Returns R_WT (samples, 3, 3) of roll, pitch and yaw (samples, 3) [rad]."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).T, np.sin(angles).T
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def imu_biases(log: Log, robot: Robot) -> dict[str, float]:
    """Returns what the IMU reads at rest at the start of the log, besides gravity; 0 without rest.

    Keys are those of the table of unknowns.
    """
    rates, forces = vector_names("imu.angular_velocity"), vector_names("imu.specific_force")
    count = rest_rows(log)
    if count == 1:
        return {f"{BIAS}{name}": 0.0 for name in (*rates, *forces)}
    part = log.part(slice(0, count)).recording
    turn = _turns(np.nanmean(part.columns(ATTITUDE), axis=0)[None])[0]
    own = -np.array(robot.gravity) @ turn
    found = dict(zip(rates, np.nanmean(part.columns(rates), axis=0), strict=True))
    found |= dict(zip(forces, np.nanmean(part.columns(forces), axis=0) - own, strict=True))
    return {f"{BIAS}{name}": float(value) for name, value in found.items()}
