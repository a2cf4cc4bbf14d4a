"""The noise of readings, and whether residuals are larger than it: the misfit of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.experiment import Experiment

Array = NDArray[np.float64]
SMALLEST = 1e-9  # noise, in the units of the channels
CLIPPED = 5.0  # deviations    of a residual in the test whether the model explains the log
# Largest mean square of residuals over that of the readings' noise, of many readings. That of the
# noise has a relative deviation of about 3.8 over the root of their number.
EXPLAINED = 1.1
REJECTED = 2.0  # likewise: errors of the model are as large as the noise, and move all numbers
UNCERTAIN, DEVIATIONS = 3.8, 3.0


@dataclass(frozen=True)
class Misfit:
    """How large residuals of a channel are."""

    value: float  # mean square of residuals over that of the noise
    readings: int

    @property
    def explained(self) -> bool:
        """Whether the noise of the readings may be all of it."""
        return self.value <= EXPLAINED + self._uncertain

    @property
    def rejected(self) -> bool:
        """Whether errors of the model are as large as the noise."""
        return self.value > REJECTED + self._uncertain

    @property
    def _uncertain(self) -> float:
        return DEVIATIONS * UNCERTAIN / float(np.sqrt(self.readings))


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
