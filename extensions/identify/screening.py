"""Finds readings of a log that are dead or wrong, so that they are named and not fitted.

A column is judged by itself and by its simulation with the robot file. That may be another robot,
so that only a sign counts that is clearly wrong, and a scale that no robot explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.log import CHANNELS, channel_of
from hexapod_cosim.models.arrays import Array

MOST_MISSING = 0.1  # of the rows
LONGEST_STUCK = 0.1  # of the rows
MOVES = 0.2  # of a column's spread: what a simulation changes while a reading is stuck
FOLLOWS, AGAINST = 0.5, -0.6  # correlations of readings with the simulation
DEGREES = (30.0, 110.0)  # readings over simulation: 57.3 within a factor of 1.9
UNIT = 30.0  # a column that is larger or smaller by this factor has another unit
# Least deviation of a simulated column whose sign is judged: a robot that walks straight drifts to
# either side by less.
LEAST_SPREAD = {"position": 0.03, "attitude": 0.03, "gyroscope": 0.05}  # m, rad, rad/s


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
    bad = []
    sides = zip(experiment.columns, experiment.measured.T, simulated.T, strict=True)
    for name, x, y in sides:
        why = _dead(x, y, experiment.log.time) or _wrong(name, x, y)
        if why:
            bad.append(BadColumn(name, why))
    return bad


def _dead(measured: Array, simulated: Array, time: Array) -> str | None:
    """Returns why a column is dead while its simulation moves; None if it is not."""
    known = np.isfinite(measured)
    missing = int(np.sum(~known))
    if missing > MOST_MISSING * len(measured):
        return f"no number in {missing} of {len(measured)} rows"
    if np.ptp(measured[known]) == 0.0 and np.ptp(simulated) > 0.0:
        return f"dead: {measured[known][0]:g} in every row"
    begin, end = _longest_run(measured)
    moved = float(np.ptp(simulated[begin:end]))
    if end - begin > LONGEST_STUCK * len(measured) and moved > MOVES * float(np.ptp(simulated)):
        return f"stuck at {measured[begin]:g} from {time[begin]:.3g} s to {time[end - 1]:.3g} s"
    return None


def _wrong(name: str, measured: Array, simulated: Array) -> str | None:
    """Returns that a column has the wrong sign or unit; None if it has not."""
    channel, spread = channel_of(name), float(np.std(simulated))
    own = _correlation(measured, simulated)
    if own < AGAINST and spread > LEAST_SPREAD.get(channel.key, 0.0):
        return f"wrong sign: its correlation with the simulation is {own:.2f}"
    if not own > FOLLOWS:
        return None
    scale = float(np.nanstd(measured)) / spread
    if channel.unit.startswith("rad") and DEGREES[0] < scale < DEGREES[1]:
        return f"in degrees: {scale:.0f} times the simulation"
    if not 1.0 / UNIT < scale < UNIT:
        return f"not in {channel.unit.replace('.', ' ')}: {scale:.3g} times the simulation"
    return None


def _correlation(a: Array, b: Array) -> float:
    """Returns the coefficient of correlation of readings and a simulation; NaN of a constant."""
    known = np.isfinite(a)
    x, y = a[known] - np.mean(a[known]), b[known] - np.mean(b[known])
    size = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / size if size > 0.0 else float("nan")


def _longest_run(values: Array) -> tuple[int, int]:
    """Returns begin and end of the longest run of equal values."""
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    bounds = np.concatenate([[0], edges, [len(values)]])
    k = int(np.argmax(np.diff(bounds)))
    return int(bounds[k]), int(bounds[k + 1])
