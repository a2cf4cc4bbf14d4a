"""The noise of readings, the misfit of the model beyond it, and which numbers the readings
determine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
SMALLEST = 1e-9  # noise, in the units of the channels
CLIPPED = 5.0  # deviations    of a residual in the test whether the model explains the log
# Largest mean square of residuals over that of the readings' noise, of many readings. That of the
# noise has a relative deviation of about 3.8 over the root of their number.
EXPLAINED = 1.1
UNCERTAIN, DEVIATIONS = 3.8, 3.0
DETERMINED = 0.5  # of the prior deviation: a number with less is determined by the logs
NEARLY_NULL = 4.0  # information [1/prior^2] of a combination: a deviation of half of a prior
# deviation of a number by nearly null combinations alone, from which on it is not determined
BY_NULL = 1.0 / 3.0  # priors


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


def determined(information: Array) -> Flags:
    """Returns which numbers readings of an information (rows, rows) determine (rows,).

    These have at most half of the deviation that they had before, and no large share in a
    combination of numbers with a larger deviation than that.
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
