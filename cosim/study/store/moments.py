"""Counts, means and squared deviations of many samples at once, kept instead of their values:
memory does not grow with these.

Within a block of values both are summed in two passes; blocks are put together as Chan, Golub and
LeVeque do (1983):

    mean = mean_a + d n_b/n        square = square_a + square_b + d^2 n_a n_b/n        d = mean_b -
    mean_a, n = n_a + n_b
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
    """Of samples, one at each place of the arrays."""

    count: Array
    mean: Array  # 0 of an empty sample
    square: Array  # sum of squared deviations from the mean

    def __getitem__(self, place: Any) -> Moments:
        return Moments(self.count[place], self.mean[place], self.square[place])

    @property
    def value(self) -> Array:
        """The means, NaN of empty samples."""
        return np.where(self.count > 0, self.mean, math.nan)

    @property
    def half_width(self) -> Array:
        """Half of Student's 95 % intervals; NaN for fewer than two values."""
        return half_widths(self.count, self.square)

    def merged(self, other: Moments) -> Moments:
        """Each sample with the other's at its place."""
        count = self.count + other.count
        share = other.count / np.maximum(count, 1.0)
        apart = other.mean - self.mean
        return Moments(
            count,
            self.mean + apart * share,
            self.square + other.square + apart**2 * self.count * share,
        )


def ratio_half_widths(before: Moments, after: Moments, difference: Moments) -> Array:
    """Of pairs, half of the 95 % intervals of ln(mean after / mean before); NaN where there is
    none.
    """
    return log_half_widths(
        difference.count, before.mean, after.mean, (before.square, after.square, difference.square)
    )


def no_moments(*shape: int) -> Moments:
    """Of empty samples."""
    return Moments(np.zeros(shape), np.zeros(shape), np.zeros(shape))


def moments_of(values: Array, valid: Truths, starts: Numbers) -> Moments:
    """Of the valid ones among values (n, ...), in groups of neighbours that begin at `starts`
    (g,), the first at 0; (g, ...).
    """
    count = np.add.reduceat(valid, starts, axis=0, dtype=np.float64)
    sizes = np.diff(np.append(starts, len(values)))
    kept = np.where(valid, values, 0.0)
    mean = np.add.reduceat(kept, starts, axis=0) / np.maximum(count, 1.0)
    apart = np.where(valid, values - np.repeat(mean, sizes, axis=0), 0.0)
    return Moments(count, mean, np.add.reduceat(apart**2, starts, axis=0))


def appended(first: Moments, second: Moments) -> Moments:
    """The samples of both, along the first axis."""
    pairs = ((first.count, second.count), (first.mean, second.mean), (first.square, second.square))
    return Moments(*(np.concatenate(pair) for pair in pairs))
