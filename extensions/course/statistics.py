"""Intervals of success rates, and of medians over cases.

The success rate has Wilson's interval.

The ratio of a case is the mean of a quantity over its pairs of runs under a control, over the mean
under the reference. Of several cases the median of the ratios counts. Its interval is a percentile
bootstrap: pairs are drawn with replacement within each case, because the cases are fixed and only
the seeds are a sample. Means, changes and Student's intervals of one case are those of
results/comparison.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.cosim.results.comparison import CONFIDENCE
from hexapod_cosim.models.arrays import Array

DRAWS = 2000  # of the bootstrap
STREAM = 18  # of its random numbers


@dataclass(frozen=True)
class Interval:
    """A value with the interval of confidence around it; NaN where there is none."""

    value: float
    low: float = math.nan
    high: float = math.nan

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON."""
        return {"value": self.value, "low": self.low, "high": self.high}


@dataclass(frozen=True)
class Rate:
    """Successes among a number of runs."""

    successes: int
    runs: int

    @property
    def interval(self) -> Interval:
        """The share of successes with Wilson's interval; NaN without runs."""
        from scipy.stats import binomtest  # noqa: PLC0415  slow to import

        if not self.runs:
            return Interval(math.nan)
        found = binomtest(self.successes, self.runs).proportion_ci(CONFIDENCE, method="wilson")
        return Interval(self.successes / self.runs, float(found.low), float(found.high))

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON."""
        counts = {"successes": self.successes, "runs": self.runs}
        return {**counts, **self.interval.as_table()}


def median_ratio(samples: Sequence[Array]) -> Interval:
    """Returns the median over cases of the ratio of means, with its bootstrap interval.

    samples: of each case, the pairs (n, 2) of values under the reference and under the control.
    """
    if not samples:
        return Interval(math.nan)
    ratios = [float(np.divide(*pairs.mean(axis=0)[::-1])) for pairs in samples]
    value = float(np.median(ratios))
    if min(map(len, samples)) < 2:
        return Interval(value)
    generator = np.random.default_rng(STREAM)
    drawn = np.array([_drawn_ratios(pairs, generator) for pairs in samples])
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = np.quantile(np.median(drawn, axis=0), [tail, 1.0 - tail])
    return Interval(value, float(low), float(high))


def _drawn_ratios(pairs: Array, generator: np.random.Generator) -> Array:
    """Returns the ratios of means (DRAWS,) over pairs drawn with replacement."""
    means = pairs[generator.integers(0, len(pairs), (DRAWS, len(pairs)))].mean(axis=1)
    return np.asarray(means[:, 1] / means[:, 0])
