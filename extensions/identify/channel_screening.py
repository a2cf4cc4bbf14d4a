"""Finds readings whose unit or sign is wrong in a whole channel, or in a column of IMU and pose.

Columns of legs are judged against those of the other legs (screening.py). Here a channel is judged
by the simulation alone. It may be that of another robot, so that only a wrong sign counts and a
scale that no robot explains.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.log import CHANNELS, Channel
from hexapod_cosim.extensions.identify.screening import (
    AGAINST,
    DEGREES,
    BadColumn,
    correlation,
    screened_columns,
)
from hexapod_cosim.extensions.identify.start import HIGHEST, rest_rows

Array = NDArray[np.float64]
CLEAR = 0.9  # correlation of a single column whose sign counts
ALIKE = 2.0  # a column of the wrong sign is as large as the simulation within this factor
UNIT = 30.0  # a channel that is larger or smaller by this factor has another unit
LEAST_REST = 10  # rows of rest whose mean is compared
# Least deviation of a simulated column whose sign is judged: a robot that walks straight drifts to
# either side by less. A gyroscope is judged by its integral.
LEAST_SPREAD = {"position": 0.02, "attitude": 0.02, "gyroscope": 0.02}  # m, rad, rad
DRIFTS = ("torso.yaw", "imu.angular_velocity[3]")
LEAST_DRIFT = 0.1  # rad   of these
LEAST_SHARE = 0.3  # of the largest deviation of a coordinate
FALLS = 1.0  # m/s2  a simulated accelerometer reads less in a robot that falls
HEIGHT = "torso.position[3]"


def screened(experiment: Experiment, simulated: Array) -> list[BadColumn]:
    """Returns all readings that cannot be the robot's: columns first, then channels.

    simulated: what the robot file predicts (rows, columns).
    """
    bad = screened_columns(experiment, simulated)
    names = {one.name for one in bad}
    kept = [k for k, name in enumerate(experiment.columns) if name not in names]
    return bad + wrong_channels(experiment.without(sorted(names)), simulated[:, kept])


def wrong_channels(experiment: Experiment, simulated: Array) -> list[BadColumn]:
    """Returns the columns of channels with another unit or sign, and single such columns of IMU and
    pose.

    simulated: what the robot file predicts (rows, columns).
    """
    found = []
    measured, keys = experiment.measured, np.array(experiment.channels)
    rest = rest_rows(experiment.log)
    for channel in CHANNELS:
        own = np.flatnonzero(keys == channel.key)
        names = [experiment.columns[k] for k in own]
        x, y = measured[:, own], simulated[:, own]
        if channel.key == "accelerometer":
            why = _gravity(names, x, y, rest)
        else:
            why = _single(channel, names, x, y, experiment.log.time, rest)
            rest_of = [k for k, name in enumerate(names) if name not in why]
            whole = _whole(channel, x[:, rest_of], y[:, rest_of]) if rest_of else None
            why |= {names[k]: whole for k in rest_of if whole}
        found += [BadColumn(name, why[name]) for name in names if name in why]
    return found


def turned_after_the_fit(experiment: Experiment, simulated: Array) -> list[BadColumn]:
    """Returns the columns of IMU and pose that move against the simulation of the found robot.

    simulated: its predictions (rows, columns).
    """
    body = {name for one in CHANNELS if one.sensors in ("imu", "pose") for name in one.names}
    found = []
    for name, x, y in zip(experiment.columns, experiment.measured.T, simulated.T, strict=True):
        own = correlation(x, y) if name in body else 0.0
        if own < AGAINST and _alike(x, y):
            found.append(BadColumn(name, _sign(own)))
    return found


def _alike(measured: Array, simulated: Array) -> bool:
    """Returns whether a column deviates about as much as the simulation."""
    size, spread = float(np.nanstd(measured)), float(np.std(simulated))
    return spread / ALIKE < size < spread * ALIKE


def _sign(own: float) -> str:
    return f"wrong sign: its correlation with the simulation is {own:.2f}"


def _whole(channel: Channel, measured: Array, simulated: Array) -> str | None:
    """Returns why a channel (rows, columns) has the wrong unit or sign; None if it has not."""
    own, size, spread = _pooled(measured, simulated)
    if own < AGAINST and channel.key not in LEAST_SPREAD:
        return f"wrong sign: the correlation of the channel with the simulation is {own:.2f}"
    return _unit(channel, own, size, spread)


def _unit(channel: Channel, own: float, measured: float, simulated: float) -> str | None:
    """Returns that deviations of a correlation differ by their unit; None if not."""
    if not own > -AGAINST:  # NaN of a constant too
        return None
    scale = measured / simulated
    if channel.unit.startswith("rad") and DEGREES[0] < scale < DEGREES[1]:
        return f"in degrees: {scale:.0f} times the simulation"
    if not 1.0 / UNIT < scale < UNIT:
        return f"not in {channel.unit.replace('.', ' ')}: {scale:.3g} times the simulation"
    return None


def _pooled(measured: Array, simulated: Array) -> tuple[float, float, float]:
    """Returns the correlation of all columns, each about its mean, and their deviations."""
    known = np.isfinite(measured)
    count = np.maximum(known.sum(axis=0), 1)
    x, y = (
        (values - np.where(known, values, 0.0).sum(axis=0) / count)[known]
        for values in (measured, simulated)
    )
    return correlation(x, y), float(np.std(x)), float(np.std(y))


def _gravity(names: list[str], measured: Array, simulated: Array, rest: int) -> dict[str, str]:
    """Returns why an accelerometer at rest does not read gravity, by column; empty if it does."""
    if rest < LEAST_REST or len(names) != 3 or not np.isfinite(measured[:rest]).any(axis=0).all():
        return {}
    reads, expected = np.nanmean(measured[:rest], axis=0), np.mean(simulated[:rest], axis=0)
    size, gravity = float(np.linalg.norm(reads)), float(np.linalg.norm(expected))
    if gravity < FALLS:
        return {}
    if not gravity / ALIKE < size < gravity * ALIKE:
        text = f"at rest the accelerometer reads {size:.3g} m/s2 instead of {gravity:.3g}"
        return dict.fromkeys(names, text)
    if float(reads @ expected) > AGAINST * size * gravity:
        return {}
    text = "wrong sign: at rest an accelerometer reads the acceleration upwards"
    heavy = np.abs(expected) > 0.5 * gravity
    light = _pooled(measured[:, ~heavy], simulated[:, ~heavy])[0]
    return {name: text for name, own in zip(names, heavy, strict=True) if own or light < 0.0}


def _single(
    channel: Channel, names: list[str], measured: Array, simulated: Array, time: Array, rest: int
) -> dict[str, str]:
    """Returns why single columns (rows, columns) of IMU and pose are wrong, by name."""
    if channel.key not in LEAST_SPREAD or not names:
        return {}
    sides = zip(measured.T, simulated.T, strict=True)
    columns = [_pair(channel, *pair, time, rest) for pair in sides]
    largest = max(float(np.std(y)) for _, y in columns)
    found: dict[str, str] = {}
    for name, (x, y) in zip(names, columns, strict=True):
        own, size, spread = correlation(x, y), float(np.nanstd(x)), float(np.std(y))
        least = LEAST_DRIFT if name in DRIFTS else LEAST_SPREAD[channel.key]
        least = max(least, LEAST_SHARE * largest if channel.key == "position" else 0.0)
        if own < -CLEAR and spread > least and _alike(x, y):
            found[name] = _sign(own)
        elif spread > least or own > CLEAR:
            why = _unit(channel, own, size, spread)
            found |= {name: why} if why else {}
    if HEIGHT in names and HEIGHT not in found and rest >= LEAST_REST:
        k = names.index(HEIGHT)
        why = _height(measured[:rest, k], simulated[:rest, k])
        found |= {HEIGHT: why} if why else {}
    return found


def _height(measured: Array, simulated: Array) -> str | None:
    """Returns why the torso cannot be at a height in the rows at rest; None if it can."""
    high, stands = float(np.nanmean(measured)), float(np.mean(simulated))
    if abs(high - stands) <= HIGHEST:
        return None
    return f"{high:.3g} m at rest, where the legs hold the torso at {stands:.3g} m"


def _pair(
    channel: Channel, measured: Array, simulated: Array, time: Array, rest: int
) -> tuple[Array, Array]:
    """Returns a column and its simulation to compare: of a gyroscope the integrals."""
    known = np.isfinite(measured)
    if channel.key != "gyroscope" or known.sum() < LEAST_REST:
        return measured, simulated
    filled = np.interp(time, time[known], measured[known])
    return _turn(filled, time, rest), _turn(simulated, time, rest)


def _turn(speed: Array, time: Array, rest: int) -> Array:
    """Returns the integral of a speed (rows,) [rad], less its mean at rest, or over all rows."""
    bias = float(np.mean(speed[:rest] if rest >= LEAST_REST else speed))
    found: Array = np.cumsum((speed - bias) * np.diff(time, prepend=time[0]))
    return found
