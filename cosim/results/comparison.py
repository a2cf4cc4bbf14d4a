"""Compares runs under two controls, seed by seed: means, changes and their confidence intervals.

A pair has values a and b, their difference is d = b - a, means are over n pairs, and
t = t(0.975, n - 1) is Student's quantile.

The change is mean(d), in the metric's unit, with the interval mean(d) -+ t s(d)/sqrt(n), s being
the standard deviation. The relative change is r - 1, r = mean(b)/mean(a). Its interval is that of
ln r, by the delta method, so that it is never below -100 % and allows for the uncertainty of
mean(a). With S, the sum of squared deviations from the mean, it is

    ln r -+ t w
    w^2 = (S(a)/mean(a)^2 + S(b)/mean(b)^2 - (S(a) + S(b) - S(d))/(mean(a) mean(b))) / (n (n - 1))

where S(a) + S(b) - S(d) is twice the sum of the products of a pair's deviations. A change is
significant when the relative interval excludes 0; where a mean is not positive, so that there is no
such interval, when the interval of the difference does.

The runs of a comparison are stored in seeds.csv.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.cosim.results.metric_table import FLOORS, METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.arrays import Array

CONFIDENCE = 0.95
BETTER, WORSE, SAME = "better", "worse", "same"
LARGEST = 700.0  # logarithm whose exponential is finite
METHOD = (
    "95 % intervals are of the ratio of the means over pairs "
    "(Student's, of its logarithm), so none is below -100 %"
)
LEAST_CHANGE = 0.005  # relative; a smaller change of a single pair is neither better nor worse


@dataclass(frozen=True, kw_only=True)
class Change:
    """Change of one metric from the first runs to the second; values in the metric's unit."""

    before: float  # mean
    after: float
    half_width: float  # of the interval of the difference; NaN for a single pair
    # of the interval of ln(after/before); NaN for a single pair, and where a mean is not positive
    log_half_width: float
    pairs: int  # that have the metric
    floor: float  # a smaller change is not significant
    verdict: str  # BETTER, WORSE, SAME, or "" where neither side is better

    @property
    def difference(self) -> float:
        """Mean after minus mean before."""
        return self.after - self.before

    @property
    def scale(self) -> float:
        """The value that relative figures refer to; NaN where it is below the floor."""
        return abs(self.before) if abs(self.before) > self.floor else math.nan

    @property
    def relative(self) -> float:
        """The relative change of the mean."""
        return self.difference / self.scale

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the relative change; NaN where there is none."""
        known = math.isfinite(self.half_width * self.scale)
        if self.after == 0.0 and known:  # the metric is 0 in all second runs
            return -1.0, -1.0
        if not math.isfinite(self.log_half_width * self.scale):
            return math.nan, math.nan
        low, high = (
            math.log(self.after / self.before) + side * self.log_half_width for side in (-1.0, 1.0)
        )
        return math.expm1(low), math.expm1(min(high, LARGEST))

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON: relative figures, then those in the metric's unit."""
        low, high = self.interval
        return {
            "relative": self.relative,
            "low": low,
            "high": high,
            "difference": self.difference,
            "half_width": self.half_width,
            "pairs": self.pairs,
            "verdict": self.verdict,
        }


@dataclass(frozen=True)
class Comparison:
    """Pairs of runs of the same seed and the changes between them.

    Changes use the pairs in which both robots walked to the end and arrived; where there is none,
    all pairs that have metrics.
    """

    first: tuple[Summary, ...]
    second: tuple[Summary, ...]
    changes: Mapping[str, Change]  # by metric

    @property
    def labels(self) -> tuple[str, str]:
        """Returns the labels of the two controls."""
        return self.first[0].control, self.second[0].control

    @property
    def title(self) -> str:
        """Returns the heading of the changes."""
        first, second = self.labels
        return f"{second} against {first}"

    @property
    def seeds(self) -> list[int]:
        """The seeds of the pairs."""
        return [run.seed for run in self.first]

    @property
    def walked(self) -> dict[str, int]:
        """Number of runs, by control, in which the robot walked upright to the end and arrived."""
        return {
            label: sum(run.success for run in runs)
            for label, runs in zip(self.labels, (self.first, self.second), strict=True)
        }


def compare_runs(first: Sequence[Summary], second: Sequence[Summary]) -> Comparison:
    """Compares runs pair by pair. Raises HexapodError when their seeds differ."""
    if [run.seed for run in first] != [run.seed for run in second] or not first:
        got = f"seeds {[run.seed for run in first]} and {[run.seed for run in second]}"
        raise HexapodError(
            "runs that cannot be compared",
            got=got,
            expected="the same seeds in the same order",
            fix="run both again",
        )
    judged = judged_pairs(first, second)
    changes = {
        name: change_of(name, [(a.metrics[name], b.metrics[name]) for a, b in judged])
        for name in METRICS
    }
    return Comparison(tuple(first), tuple(second), changes)


def judged_pairs(
    first: Sequence[Summary], second: Sequence[Summary]
) -> list[tuple[Summary, Summary]]:
    """Returns the pairs in which both robots arrived; where there is none, all pairs."""
    pairs = list(zip(first, second, strict=True))
    return [pair for pair in pairs if pair[0].success and pair[1].success] or pairs


def change_of(name: str, pairs: Sequence[tuple[float, float]] | Array) -> Change:
    """Returns the change of a metric over pairs (n, 2) of values, without those that lack one."""
    values = np.array(pairs, dtype=float).reshape(-1, 2)
    values = values[np.isfinite(values).all(axis=1)]
    n = len(values)
    samples = np.column_stack([values, values[:, 1] - values[:, 0]])
    mean = samples.mean(axis=0) if n else np.full(3, math.nan)
    squares = np.sum((samples - mean) ** 2, axis=0).tolist()
    before, after, _ = mean.tolist()
    return made_change(
        name,
        before=before,
        after=after,
        half_width=_half_width(n, squares[2]),
        log_half_width=_log_half_width(n, before, after, squares),
        pairs=n,
    )


def made_change(
    name: str, *, before: float, after: float, half_width: float, log_half_width: float, pairs: int
) -> Change:
    """Returns the change of a metric from its means and the half widths of its intervals.

    Means are NaN when there is no pair.
    """
    return Change(
        before=before,
        after=after,
        half_width=half_width,
        log_half_width=log_half_width,
        pairs=pairs,
        floor=FLOORS[name],
        verdict=_verdict(name, before, after, half_width, log_half_width),
    )


def half_width_of(values: Array) -> float:
    """Returns half the width of the mean's confidence interval; NaN for fewer than two values."""
    square = float(np.sum((values - values.mean()) ** 2)) if len(values) else 0.0
    return _half_width(len(values), square)


def _half_width(count: int, square: float) -> float:
    """Returns half the width of Student's interval of a mean; NaN for fewer than two values.

    square: sum of squared deviations from the mean.
    """
    from scipy.special import stdtrit  # noqa: PLC0415  slow to import

    if count < 2:
        return math.nan
    quantile = float(stdtrit(count - 1.0, 0.5 + 0.5 * CONFIDENCE))
    return quantile * math.sqrt(square / (count * (count - 1.0)))


def _log_half_width(count: int, before: float, after: float, squares: Sequence[float]) -> float:
    """Returns half the width of the interval of ln(after/before); NaN unless both means are > 0.

    squares: sums of squared deviations from the mean: of the first values, the second values and
    the differences.
    """
    if not min(before, after) > 0.0:
        return math.nan
    first, second, apart = squares
    # the equation of the module's docstring, rearranged to avoid cancellation
    square = (1.0 / before - 1.0 / after) * (first / before - second / after)
    return _half_width(count, max(square + apart / (before * after), 0.0))


def _verdict(
    name: str, before: float, after: float, half_width: float, log_half_width: float
) -> str:
    """Returns BETTER, WORSE, SAME, or "" where neither side is better or there is no mean."""
    less_is_better, difference = METRICS[name][1], after - before
    if less_is_better is None or math.isnan(difference):
        return ""
    change, unsure = difference, half_width
    if math.isfinite(log_half_width) and abs(before) > FLOORS[name]:
        change, unsure = math.log(after) - math.log(before), log_half_width
    elif math.isnan(half_width):
        unsure = LEAST_CHANGE * abs(before)
    if abs(difference) < FLOORS[name] or abs(change) <= unsure:
        return SAME
    return BETTER if (difference < 0.0) == less_is_better else WORSE
