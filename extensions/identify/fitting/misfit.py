"""The noise of readings, the misfit of the model beyond it, and which numbers the readings
determine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.fitting.least_squares import UNLIKE
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.models.arrays import Array

Flags = NDArray[np.bool_]
SMALLEST = 1e-9  # noise, in the units of the channels
CLIPPED = 5.0  # deviations    of a residual in the test whether the model explains the log
# Largest mean square of residuals over that of the readings' noise, of many readings. That of the
# noise has a relative deviation of about 3.8 over the root of their number.
EXPLAINED = 1.1
UNCERTAIN, DEVIATIONS = 3.8, 3.0
DETERMINED = 0.5  # of the prior deviation: a number with less is determined by the logs
NEARLY_NULL = 1.0  # information [1/prior^2] of a combination: less than what was known before
# deviation of a number by nearly null combinations alone, from which on it is not determined
BY_NULL = 1.0 / 3.0  # priors
WEAK = 1000.0  # information [1/prior^2] of a combination that is simulated as a whole
LEAST = 0.05  # information [1/prior^2] of a combination that says nothing whatever its errors are
LONGEST = 0.5  # priors    of such a move


@dataclass(frozen=True)
class Misfit:
    """How large residuals of a channel are."""

    value: float  # mean square of residuals over that of the noise
    readings: int

    @property
    def explained(self) -> bool:
        """Whether the noise of the readings may be all of it."""
        return self.value <= EXPLAINED + DEVIATIONS * UNCERTAIN / float(np.sqrt(self.readings))


def read_noise(experiments: Sequence[Experiment]) -> dict[str, float]:
    """Returns the noise of each channel from the readings alone.

    It is a robust estimate from second differences, in which slow motions cancel:
    median |y[k-1] - 2 y[k] + y[k+1]| / (0.6745 sqrt 6).
    """
    found: dict[str, list[Array]] = {}
    for one in experiments:
        second = np.abs(np.diff(one.measured[one.fitted], n=2, axis=0))
        for key, column in zip(one.channels, second.T, strict=True):
            found.setdefault(key, []).append(column)
    scale = 0.6745 * np.sqrt(6.0)
    return {key: float(np.nanmedian(np.concatenate(own))) / scale for key, own in found.items()}


def misfits(
    experiments: Sequence[Experiment],
    predictions: Sequence[Array],
    noise: Mapping[str, float],
    part: str,
) -> dict[str, Misfit]:
    """Returns the mean square of residuals over that of a noise, by channel.

    It is 1 where the model explains the readings. Residuals beyond five deviations count as five.
    part: "fitted" or "held_out" rows.
    """
    found: dict[str, list[Array]] = {}
    for one, own in zip(experiments, predictions, strict=True):
        error = (own - one.measured)[getattr(one, part)]
        for key, column in zip(one.channels, error.T, strict=True):
            size = column[np.isfinite(column)] / max(noise[key], SMALLEST)
            found.setdefault(key, []).append(np.clip(size, -CLIPPED, CLIPPED) ** 2)
    joined = {key: np.concatenate(parts) for key, parts in found.items()}
    return {
        key: Misfit(float(np.mean(values)), len(values))
        for key, values in joined.items()
        if len(values)
    }


def sharpened(problem: Problem, z: Array, jacobian: Array, information: Array) -> Array:
    """Returns the derivatives with those by weak combinations from simulations over long steps.

    Over a long step readings may jump: where both derivatives differ, the smaller one counts.

    Args:
        problem: its readings that count.
        z: the numbers (rows,).
        jacobian: derivatives of the residuals, with the priors behind them.
        information: what these say (rows, rows).

    A combination whose simulation fails stays as it is.
    """
    found = jacobian.copy()
    count = len(jacobian) - len(z)
    low, high = problem.bounds()
    values, vectors = np.linalg.eigh(information)
    for value, vector in zip(values.tolist(), vectors.T, strict=True):
        if not LEAST < value < WEAK:
            continue
        step = min(LONGEST, value**-0.5) * vector
        forth, back = (np.clip(z + sign * step, low, high) for sign in (1.0, -1.0))
        change = (problem.residuals(forth) - problem.residuals(back))[:count]
        linear, length = jacobian[:count] @ (forth - back), float((forth - back) @ vector)
        if length <= 0.0 or not np.isfinite(change).all():
            continue
        smaller = np.where(np.abs(change) < np.abs(linear), change, linear)
        differ = np.abs(change - linear) > UNLIKE * np.abs(smaller)
        shown = np.where(differ, smaller, change)
        if shown @ shown < linear @ linear:  # more is what bends or jumps over the long step
            found[:count] += np.outer((shown - linear) / length, vector)
    return found


def determined(information: Array) -> Flags:
    """Returns which numbers readings of an information (rows, rows) determine (rows,).

    These have at most half of the deviation that they had before, and no large share in a
    combination of numbers of which the readings say less than was known.
    """
    covariance = np.linalg.inv(information + np.eye(len(information)))
    small = np.sqrt(np.diag(covariance)) < DETERMINED
    values, vectors = np.linalg.eigh(information)
    null = vectors[:, values < NEARLY_NULL]
    return np.asarray(small & (np.sqrt(np.sum(null**2, axis=1)) < BY_NULL))


def to_keep(information: Array, candidates: Flags) -> Flags:
    """Returns the numbers that are to stay as they were, so that readings determine all others.

    Of the candidates (rows,) that are not determined the one with the largest deviation stays; the
    others are judged again with it known, and so on.
    """
    kept = np.zeros(len(information), dtype=np.bool_)
    while True:
        free = np.flatnonzero(~kept)
        own = information[np.ix_(free, free)]
        open_ones = candidates[free] & ~determined(own)
        if not open_ones.any():
            return kept
        deviations = np.diag(np.linalg.inv(own + np.eye(len(own))))
        kept[free[int(np.argmax(np.where(open_ones, deviations, -1.0)))]] = True
