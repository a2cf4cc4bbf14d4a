"""Finds readings of a log that are dead or wrong, so that they are named and not fitted.

A column is judged by itself and by its simulation with the robot file. That may be another robot,
so that only a wrong sign counts, and a scale that no robot explains. A column of a leg is judged
where those of the other legs follow the simulation, a column of IMU and pose where it moves enough,
and each channel as a whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.log import CHANNELS, Channel
from hexapod_cosim.extensions.identify.start import HIGHEST, rest_rows
from hexapod_cosim.models import LEG_NAMES

Array = NDArray[np.float64]
MOST_MISSING = 0.1  # of the rows
LONGEST_STUCK = 0.1  # of the rows
MOVES = 0.2  # of a column's spread: what a simulation changes while a reading is stuck
RESOLVED = 10.0  # of an angle's resolution: likewise
FOLLOWS, WEAK, AGAINST = 0.8, 0.4, -0.5  # correlations of readings with the simulation
CLEAR = 0.9  # correlation of a single column of IMU or pose whose sign counts
DEGREES = (30.0, 110.0)  # readings over simulation: 57.3 within a factor of 1.9
UNIT = 30.0  # a channel that is larger or smaller by this factor has another unit
LEAST_SIBLINGS = 3
LEAST_REST = 10  # rows of rest whose mean is compared
# Least deviation of a simulated column whose sign is judged: a robot that walks straight drifts to
# either side by less. A gyroscope is judged by its integral.
LEAST_SPREAD = {"position": 0.02, "attitude": 0.02, "gyroscope": 0.02}  # m, rad, rad
DRIFTS = ("torso.yaw", "imu.angular_velocity[3]")
LEAST_DRIFT = 0.1  # rad   of these
LEAST_SHARE = 0.3  # of the largest deviation of a coordinate
ALIKE = 2.0  # factor between the sizes of readings and simulation that a wrong sign leaves
FALLS = 1.0  # m/s2  a simulated accelerometer reads less in a robot that falls
HEIGHT = "torso.position[3]"


@dataclass(frozen=True)
class BadColumn:
    """A column that is left out, and why."""

    name: str
    why: str


def left_out(
    bad: Sequence[BadColumn], one: str = "is left out", many: str = "are left out"
) -> list[str]:
    """Returns sentences on bad columns; a single one for a channel whose columns are all bad for
    the same reason, as currents of servos that do not measure them.

    one, many: the predicate of the sentences.
    """
    texts = []
    whole: set[str] = set()
    why = {column.name: column.why for column in bad}
    for channel in CHANNELS:
        reasons = {why.get(name) for name in channel.names}
        if len(reasons) == 1 and None not in reasons:
            whole |= set(channel.names)
            text = f"All {len(channel.names)} columns of {channel.title!r} {many}"
            texts.append(f"{text}: {why[channel.names[0]]}.")
    own = [column for column in bad if column.name not in whole]
    return texts + [f"{column.name} {one}: {column.why}." for column in own]


def screened(experiment: Experiment, simulated: Array) -> list[BadColumn]:
    """Returns the readings that cannot be the robot's.

    simulated: what the robot file predicts (rows, columns).
    """
    bad: dict[str, str] = {}
    for channel in CHANNELS:
        names = [name for name in experiment.columns if name in channel.names]
        places = [experiment.columns.index(name) for name in names]
        pair = experiment.measured[:, places], simulated[:, places]
        dead = _dead_columns(names, *pair, experiment.log.time)
        keep = [k for k, name in enumerate(names) if name not in dead]
        sound = [names[k] for k in keep]
        x, y = pair[0][:, keep], pair[1][:, keep]
        bad |= dead | _wrong_columns(experiment, channel, sound, x, y)
    return [BadColumn(name, bad[name]) for name in experiment.columns if name in bad]


def _dead_columns(
    names: Sequence[str], measured: Array, simulated: Array, time: Array
) -> dict[str, str]:
    """Returns why columns (rows, names) are dead, stuck or full of gaps, by name."""
    sides = zip(names, measured.T, simulated.T, strict=True)
    found = {name: dead_column(name, x, y, time) for name, x, y in sides}
    return {name: why for name, why in found.items() if why}


def dead_column(name: str, measured: Array, simulated: Array, time: Array) -> str | None:
    """Returns why a column is dead while its simulation moves; None if it is not."""
    known = np.isfinite(measured)
    missing = int(np.sum(~known))
    if missing > MOST_MISSING * len(measured):
        return f"no number in {missing} of {len(measured)} rows"
    if np.ptp(measured[known]) == 0.0 and np.ptp(simulated) > 0.0:
        return f"dead: {measured[known][0]:g} in every row"
    begin, end = longest_run(measured)
    moved = float(np.ptp(simulated[begin:end]))
    least = MOVES * float(np.ptp(simulated))
    if name.endswith(".angle"):  # other readings are zero for long, such as forces in the air
        least = min(least, RESOLVED * _resolution(measured))
    if end - begin > LONGEST_STUCK * len(measured) and moved > least:
        return f"stuck at {measured[begin]:g} from {time[begin]:.3g} s to {time[end - 1]:.3g} s"
    return None


def _resolution(measured: Array) -> float:
    """Returns the median size of the changes from row to row, which noise and quantisation set."""
    changes = np.abs(np.diff(measured[np.isfinite(measured)]))
    return float(np.median(changes[changes > 0.0])) if np.any(changes > 0.0) else 0.0


def _wrong_columns(
    experiment: Experiment, channel: Channel, names: list[str], measured: Array, simulated: Array
) -> dict[str, str]:
    """Returns why columns (rows, names) of a channel have a wrong sign or unit, by name."""
    rest = rest_rows(experiment.log)
    if channel.key == "accelerometer":
        return _gravity(names, measured, simulated, rest)
    if channel.key in LEAST_SPREAD:
        found = _body_columns(channel, names, measured, simulated, experiment.log.time, rest)
    else:
        found = _leg_columns(channel, names, measured, simulated)
    others = [k for k, name in enumerate(names) if name not in found]
    x, y = _centred(measured[:, others], simulated[:, others])
    why = _wrong(channel, x, y, sign=channel.key not in LEAST_SPREAD)
    return found | {names[k]: why for k in others if why}


def _leg_columns(
    channel: Channel, names: list[str], measured: Array, simulated: Array
) -> dict[str, str]:
    """Returns why columns do not follow the simulation as those of the other legs do, by name."""
    sides = list(zip(measured.T, simulated.T, strict=True))
    follows = {name: correlation(x, y) for name, (x, y) in zip(names, sides, strict=True)}
    found = {}
    for name, (x, y) in zip(names, sides, strict=True):
        leg, _, kind = name.partition(".")
        others = [f"{other}.{kind}" for other in LEG_NAMES if other != leg]
        siblings = [follows[other] for other in others if np.isfinite(follows.get(other, np.nan))]
        own = follows[name]  # NaN of a foot in the air in all rows
        if len(siblings) < LEAST_SIBLINGS or np.median(siblings) <= FOLLOWS or not np.isfinite(own):
            continue
        why = _wrong(channel, x, y)
        if why is None and own <= WEAK:
            why = f"does not follow the commands: its correlation with the simulation is {own:.2f}"
        if why:
            found[name] = why
    return found


def _body_columns(
    channel: Channel, names: list[str], measured: Array, simulated: Array, time: Array, rest: int
) -> dict[str, str]:
    """Returns why single columns (rows, names) of gyroscope and pose are wrong, by name."""
    if not names:
        return {}
    sides = zip(measured.T, simulated.T, strict=True)
    if channel.key == "gyroscope":
        columns = [(_turn(x, time, rest), _turn(y, time, rest)) for x, y in sides]
    else:
        columns = list(sides)
    largest = max(float(np.std(y)) for _, y in columns)
    found: dict[str, str] = {}
    for name, (x, y) in zip(names, columns, strict=True):
        own, spread = correlation(x, y), float(np.std(y))
        least = LEAST_DRIFT if name in DRIFTS else LEAST_SPREAD[channel.key]
        least = max(least, LEAST_SHARE * largest if channel.key == "position" else 0.0)
        turned = own < -CLEAR and spread / ALIKE < float(np.nanstd(x)) < spread * ALIKE
        why = _wrong(channel, x, y, sign=turned) if spread > least or own > CLEAR else None
        if name == HEIGHT and why is None and rest >= LEAST_REST:
            why = _height(x[:rest], y[:rest])
        if why:
            found[name] = why
    return found


def _wrong(channel: Channel, measured: Array, simulated: Array, *, sign: bool = True) -> str | None:
    """Returns that a column or a channel has the wrong sign or unit; None if it has not.

    sign: whether a wrong sign counts.
    """
    own = correlation(measured, simulated)
    if own < AGAINST and sign:
        return f"wrong sign: its correlation with the simulation is {own:.2f}"
    if not own > -AGAINST:  # NaN of a constant too
        return None
    scale = float(np.nanstd(measured) / np.std(simulated))
    if channel.unit.startswith("rad") and DEGREES[0] < scale < DEGREES[1]:
        return f"in degrees: {scale:.0f} times the simulation"
    if not 1.0 / UNIT < scale < UNIT:
        return f"not in {channel.unit.replace('.', ' ')}: {scale:.3g} times the simulation"
    return None


def _centred(measured: Array, simulated: Array) -> tuple[Array, Array]:
    """Returns all known readings of columns and their simulation, each about its column's mean."""
    known = np.isfinite(measured)
    count = np.maximum(known.sum(axis=0), 1)
    x, y = (
        (values - np.where(known, values, 0.0).sum(axis=0) / count)[known]
        for values in (measured, simulated)
    )
    return x, y


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
    light = correlation(*_centred(measured[:, ~heavy], simulated[:, ~heavy]))
    return {name: text for name, own in zip(names, heavy, strict=True) if own or light < 0.0}


def _height(measured: Array, simulated: Array) -> str | None:
    """Returns why the torso cannot be at a height in the rows at rest; None if it can."""
    high, stands = float(np.nanmean(measured)), float(np.mean(simulated))
    if abs(high - stands) <= HIGHEST:
        return None
    return f"{high:.3g} m at rest, where the legs hold the torso at {stands:.3g} m"


def _turn(speed: Array, time: Array, rest: int) -> Array:
    """Returns the integral of a speed (rows,) [rad], less its mean at rest, or over all rows."""
    known = np.isfinite(speed)
    filled = np.interp(time, time[known], speed[known])
    bias = float(np.mean(filled[:rest] if rest >= LEAST_REST else filled))
    found: Array = np.cumsum((filled - bias) * np.diff(time, prepend=time[0]))
    return found


def correlation(a: Array, b: Array) -> float:
    """Returns the coefficient of correlation of readings and a column without gaps; NaN of a
    constant.
    """
    known = np.isfinite(a)
    if not known.any():
        return float("nan")
    x, y = a[known] - np.mean(a[known]), b[known] - np.mean(b[known])
    size = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / size if size > 0.0 else float("nan")


def longest_run(values: Array) -> tuple[int, int]:
    """Returns begin and end of the longest run of equal values."""
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    bounds = np.concatenate([[0], edges, [len(values)]])
    k = int(np.argmax(np.diff(bounds)))
    return int(bounds[k]), int(bounds[k + 1])
