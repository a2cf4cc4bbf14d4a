"""Running moments of many samples: count, mean and sum of squared deviations.

They are kept instead of the values, so memory does not grow with the number of values. Within a
block the moments are computed in two passes. Blocks are merged by the formulas of Chan, Golub and
LeVeque (1983), with d = mean_b - mean_a and n = n_a + n_b:

    mean   = mean_a + d n_b/n
    square = square_a + square_b + d^2 n_a n_b/n
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.comparison import half_widths, log_half_widths

Array = NDArray[np.float64]
Truths = NDArray[np.bool_]
Numbers = NDArray[np.int64]


@dataclass(frozen=True)
class Moments:
    """The moments of samples, one for each element of the arrays."""

    count: Array
    mean: Array  # 0 of an empty sample
    square: Array  # sum of squared deviations from the mean

    def __getitem__(self, place: Any) -> Moments:
        return Moments(self.count[place], self.mean[place], self.square[place])

    @property
    def value(self) -> Array:
        """The means, NaN for empty samples."""
        return np.where(self.count > 0, self.mean, math.nan)

    @property
    def half_width(self) -> Array:
        """Half widths of Student's 95 % intervals, NaN for fewer than two values."""
        return half_widths(self.count, self.square)

    def merged(self, other: Moments) -> Moments:
        """Merges each sample with the other one at the same place."""
        count = self.count + other.count
        share = other.count / np.maximum(count, 1.0)
        difference = other.mean - self.mean
        return Moments(
            count,
            self.mean + difference * share,
            self.square + other.square + difference**2 * self.count * share,
        )


def ratio_half_widths(before: Moments, after: Moments, difference: Moments) -> Array:
    """Returns half widths of the 95 % intervals of ln(mean after / mean before).

    All arguments are moments over the same pairs. The result is NaN where there is no interval.
    """
    return log_half_widths(
        difference.count, before.mean, after.mean, (before.square, after.square, difference.square)
    )


def no_moments(*shape: int) -> Moments:
    """Returns the moments of empty samples."""
    return Moments(np.zeros(shape), np.zeros(shape), np.zeros(shape))


def moments_of(values: Array, valid: Truths, starts: Numbers) -> Moments:
    """Returns the moments (g, ...) of groups of successive values.

    Args:
        values: (n, ...) the values.
        valid: (n, ...) which values count.
        starts: (g,) indices of the first values of the groups; the first is 0.
    """
    count = np.add.reduceat(valid, starts, axis=0, dtype=np.float64)
    sizes = np.diff(np.append(starts, len(values)))
    kept = np.where(valid, values, 0.0)
    mean = np.add.reduceat(kept, starts, axis=0) / np.maximum(count, 1.0)
    deviation = np.where(valid, values - np.repeat(mean, sizes, axis=0), 0.0)
    return Moments(count, mean, np.add.reduceat(deviation**2, starts, axis=0))


def concatenated(first: Moments, second: Moments) -> Moments:
    """Joins the samples of both along the first axis."""
    pairs = ((first.count, second.count), (first.mean, second.mean), (first.square, second.square))
    return Moments(*(np.concatenate(pair) for pair in pairs))
