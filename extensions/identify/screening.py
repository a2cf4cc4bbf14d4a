"""Finds readings of a log that are dead or wrong, so that they are named and not fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.log import CHANNELS
from hexapod_cosim.models import LEG_NAMES

Array = NDArray[np.float64]
MOST_MISSING = 0.1  # of the rows
LONGEST_STUCK = 0.1  # of the rows
MOVES = 0.2  # of a column's spread: what a simulation changes while a reading is stuck
RESOLVED = 10.0  # of an angle's resolution: likewise
FOLLOWS, WEAK, AGAINST = 0.8, 0.4, -0.5  # correlations of readings with the simulation
DEGREES = (30.0, 110.0)  # readings over simulation: 57.3 within a factor of 1.9
FAR = 5.0  # error of a column over the median of its channel
LEAST_SIBLINGS = 3


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


def screened_columns(experiment: Experiment, simulated: Array) -> list[BadColumn]:
    """Returns the columns whose readings cannot be the robot's, each judged by itself and its leg.

    simulated: what the robot file predicts (rows, columns). It need not be right: a column is
    judged by itself, or against the columns of the other legs, which follow the simulation.
    """
    found = []
    measured, time = experiment.measured, experiment.log.time
    follows = {
        name: correlation(measured[:, k], simulated[:, k])
        for k, name in enumerate(experiment.columns)
    }
    for k, name in enumerate(experiment.columns):
        why = _by_itself(name, measured[:, k], simulated[:, k], time)
        if why is None:
            siblings = _siblings(name, experiment.columns)
            others = [follows[other] for other in siblings if np.isfinite(follows[other])]
            if len(others) >= LEAST_SIBLINGS and np.median(others) > FOLLOWS:
                why = _against(experiment, k, measured[:, k], simulated)
        if why is not None:
            found.append(BadColumn(name, why))
    return found


def _by_itself(name: str, measured: Array, simulated: Array, time: Array) -> str | None:
    """Returns why a column is dead; None if it is not."""
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


def _against(experiment: Experiment, k: int, measured: Array, simulated: Array) -> str | None:
    """Returns why a column does not follow the simulation as its siblings do; None if it does."""
    own = correlation(measured, simulated[:, k])
    if not np.isfinite(own):  # of a foot in the air in all rows
        return None
    scale = float(np.nanstd(measured) / np.std(simulated[:, k]))
    if own < AGAINST:
        return f"wrong sign: its correlation with the simulation is {own:.2f}"
    if own > -AGAINST and DEGREES[0] < scale < DEGREES[1]:
        return f"in degrees: {scale:.0f} times the simulation"
    if own > WEAK:
        return None
    name = experiment.columns[k]
    kind = name.partition(".")[2]
    others = {
        other: correlation(measured, simulated[:, j])
        for j, other in enumerate(experiment.columns)
        if j != k and other.rpartition(".")[2] == kind.rpartition(".")[2]
    }
    best = max(others, key=lambda other: others[other])
    if others[best] > FOLLOWS:
        return f"looks like {best}: its correlation with it is {others[best]:.2f}"
    return f"does not follow the commands: its correlation with the simulation is {own:.2f}"


def misfits(experiment: Experiment, errors: Array) -> list[BadColumn]:
    """Returns the columns that a fit leaves far from the simulation.

    errors: typical error of each column (columns,), in the unit of its channel.
    """
    found = []
    for name, size in zip(experiment.columns, errors.tolist(), strict=True):
        siblings = _siblings(name, experiment.columns)
        others = [errors[experiment.columns.index(other)] for other in siblings]
        if len(others) >= LEAST_SIBLINGS and size > FAR * float(np.median(others)):
            ratio = size / float(np.median(others))
            found.append(BadColumn(name, f"its error is {ratio:.0f} times that of other legs"))
    return found


def _siblings(name: str, columns: Sequence[str]) -> list[str]:
    """Returns the columns of the other legs with the same quantity."""
    leg, _, kind = name.partition(".")
    if leg not in LEG_NAMES:
        return []
    return [
        f"{other}.{kind}" for other in LEG_NAMES if other != leg and f"{other}.{kind}" in columns
    ]


def correlation(a: Array, b: Array) -> float:
    """Returns the coefficient of correlation of readings and a column without gaps; NaN of a
    constant.
    """
    known = np.isfinite(a)
    x, y = a[known] - np.mean(a[known]) if known.any() else a, b[known] - np.mean(b[known])
    size = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / size if size > 0.0 else float("nan")


def longest_run(values: Array) -> tuple[int, int]:
    """Returns begin and end of the longest run of equal values."""
    edges = np.flatnonzero(np.diff(values) != 0.0) + 1
    bounds = np.concatenate([[0], edges, [len(values)]])
    k = int(np.argmax(np.diff(bounds)))
    return int(bounds[k]), int(bounds[k + 1])
