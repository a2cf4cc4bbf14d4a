"""Runs against runs, seed by seed: means, changes, and how sure they are; seeds.csv, where all runs
of a comparison stand.

A pair has values a and b, their difference is d = b - a, means are over n pairs, and t = t(0.975, n
- 1) is Student's quantile.

The change is mean(d), in the metric's unit, with the interval mean(d) -+ t s(d)/sqrt(n), s being
the standard deviation. The relative change is r - 1, r = mean(b)/mean(a). Its interval is that of
ln r, by the delta method, so that it is never below -100 % and knows that mean(a) is not exact
either. With S, the sum of squared deviations from the mean, it is

    ln r -+ t w        w^2 = (S(a)/mean(a)^2 + S(b)/mean(b)^2 - (S(a) + S(b) - S(d))/(mean(a)
    mean(b))) / (n (n - 1))

where S(a) + S(b) - S(d) is twice the sum of the products of a pair's deviations. A change is sure
when the relative interval leaves out 0; where there is none, because a mean is not positive, when
the other one does.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.files import atomic_text
from hexapod_cosim.cosim.results.metrics import FLOORS, METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.models import HexapodError

Array = NDArray[np.float64]

SEEDS, SEEDS_PARTIAL = "seeds.csv", "seeds.partial.csv"
CONFIDENCE = 0.95
BETTER, WORSE, SAME = "better", "worse", "same"
LARGEST = 700.0  # of a logarithm, so that its exponential is a number
METHOD = "95 % intervals are of the ratio of the means over pairs (Student's, of its logarithm), so none is below -100 %"
LEAST_CHANGE = 0.005  # of a single pair, which has no interval: less is neither better nor worse
FACTS = tuple(item.name for item in fields(Summary) if item.name != "metrics")
BETWEEN = " | "  # warnings of a run in one cell


@dataclass(frozen=True, kw_only=True)
class Change:
    """Of one metric, from the first runs to the second; values in the metric's unit."""

    before: float  # mean
    after: float
    half_width: float  # of the difference's interval; NaN for a single pair
    # of the interval of ln(after/before); NaN for a single pair, and where a mean is not positive
    log_half_width: float
    pairs: int  # that have the metric
    floor: float  # less means nothing
    verdict: str  # BETTER, WORSE, SAME, or "" where neither side is better

    @property
    def difference(self) -> float:
        return self.after - self.before

    @property
    def scale(self) -> float:
        """What relative figures are relative to; NaN where that is too small to be."""
        return abs(self.before) if abs(self.before) > self.floor else math.nan

    @property
    def relative(self) -> float:
        return self.difference / self.scale

    @property
    def interval(self) -> tuple[float, float]:
        """Of the relative change; NaN where there is none."""
        if self.after == 0.0 and math.isfinite(
            self.half_width * self.scale
        ):  # nothing is left of it in any pair
            return -1.0, -1.0
        if not math.isfinite(self.log_half_width * self.scale):
            return math.nan, math.nan
        low, high = (
            math.log(self.after / self.before) + side * self.log_half_width for side in (-1.0, 1.0)
        )
        return math.expm1(low), math.expm1(min(high, LARGEST))

    def as_table(self) -> dict[str, Any]:
        """For JSON: relative figures, then those in the metric's unit."""
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
    """Pairs of runs of the same seed and what lies between them.

    Figures are of the pairs in which both walked to the end; where there is none, of all pairs that
    have figures.
    """

    first: tuple[Summary, ...]
    second: tuple[Summary, ...]
    changes: Mapping[str, Change]  # by metric

    @property
    def labels(self) -> tuple[str, str]:
        return self.first[0].control, self.second[0].control

    @property
    def seeds(self) -> list[int]:
        return [run.seed for run in self.first]

    @property
    def walked(self) -> dict[str, int]:
        """Number of runs that came to their end with the robot on its feet, by control."""
        return {
            label: sum(run.walked for run in runs)
            for label, runs in zip(self.labels, (self.first, self.second), strict=True)
        }

    @property
    def judged(self) -> tuple[list[Summary], list[Summary]]:
        """The runs that the figures are of, in pairs."""
        pairs = judged_pairs(self.first, self.second)
        return [first for first, _ in pairs], [second for _, second in pairs]

    @property
    def means(self) -> dict[str, dict[str, float]]:
        """By control, then metric."""
        first, second = self.labels
        changes = self.changes.items()
        return {
            first: {name: item.before for name, item in changes},
            second: {name: item.after for name, item in changes},
        }

    @property
    def losses(self) -> list[str]:
        """In words, the runs whose figures are missing or those of a fall."""
        return [
            f"{run.control}, seed {run.seed}: {run.reason or '; '.join(run.warnings) or 'the robot fell'}"
            for run in (*self.first, *self.second)
            if not run.walked
        ]

    def as_table(self) -> dict[str, Any]:
        """For JSON: means by control, changes, number of seeds, and how many walked to the end."""
        changes = {name: item.as_table() for name, item in self.changes.items()}
        return {**self.means, "change": changes, "seeds": len(self.first), "walked": self.walked}


def compare_runs(first: Sequence[Summary], second: Sequence[Summary]) -> Comparison:
    """Compares runs pair by pair. Raises HexapodError when they are not of the same seeds."""
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
    """Those in which both walked to the end; where there is none, all."""
    pairs = list(zip(first, second, strict=True))
    return [pair for pair in pairs if pair[0].walked and pair[1].walked] or pairs


def change_of(name: str, pairs: Sequence[tuple[float, float]]) -> Change:
    """The change of a metric over pairs of its values, of which those without both are left out."""
    values = np.array([pair for pair in pairs if all(map(math.isfinite, pair))]).reshape(-1, 2)
    n = len(values)
    samples = np.column_stack([values, values[:, 1] - values[:, 0]])
    mean = samples.mean(axis=0) if n else np.full(3, math.nan)
    square = np.sum((samples - mean) ** 2, axis=0)
    width, log_width = (
        half_widths(np.array(n), square[2]),
        log_half_widths(np.array(n), mean[0], mean[1], square),
    )
    return made_change(
        name,
        before=float(mean[0]),
        after=float(mean[1]),
        half_width=float(width),
        log_half_width=float(log_width),
        pairs=n,
    )


def made_change(
    name: str, *, before: float, after: float, half_width: float, log_half_width: float, pairs: int
) -> Change:
    """The change of a metric from means over pairs and the intervals of their difference and
    ratio; NaN when there is no pair.
    """
    verdict = str(verdicts(name, *map(np.array, (before, after, half_width, log_half_width))))
    return Change(
        before=before,
        after=after,
        half_width=half_width,
        log_half_width=log_half_width,
        pairs=pairs,
        floor=FLOORS[name],
        verdict=verdict,
    )


def half_width_of(values: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    """Half the width of the interval in which the mean of what these are drawn from lies with
    CONFIDENCE; NaN for fewer than two.
    """
    n = len(values)
    return (
        float(half_widths(np.array(n), np.array(np.sum((values - values.mean()) ** 2))))
        if n > 1
        else math.nan
    )


def half_widths(count: Array, square: Array) -> Array:
    """Of samples by their counts and sums of squared deviations from the mean: Student's
    interval; NaN for fewer than two values.
    """
    from scipy.special import stdtrit  # noqa: PLC0415  slow to import

    free = np.where(count > 1, count - 1.0, math.nan)
    return np.asarray(
        stdtrit(free, 0.5 + 0.5 * CONFIDENCE) * np.sqrt(square / (free * (free + 1.0)))
    )


def log_half_widths(
    count: Array, before: Array, after: Array, squares: Sequence[Array] | Array
) -> Array:
    """Half the widths of the intervals of ln(after/before), of pairs by their counts and means; NaN
    where a mean is not positive.

    squares: sums of squared deviations of the first values, the second, and the differences.
    """
    from scipy.special import stdtrit  # noqa: PLC0415  slow to import

    known = (np.asarray(before) > 0.0) & (np.asarray(after) > 0.0)
    free = np.where(known & (count > 1), count - 1.0, math.nan)
    a, b = np.where(known, before, 1.0), np.where(known, after, 1.0)
    first, second, apart = squares
    square = (1.0 / a - 1.0 / b) * (first / a - second / b) + apart / (
        a * b
    )  # as above, without its cancellation
    return np.asarray(
        stdtrit(free, 0.5 + 0.5 * CONFIDENCE)
        * np.sqrt(np.maximum(square, 0.0) / (free * (free + 1.0)))
    )


def verdicts(
    name: str, before: Array, after: Array, half_width: Array, log_half_width: Array
) -> np.ndarray[Any, np.dtype[np.str_]]:
    """BETTER, WORSE, SAME, or "" where neither side is better or there is no mean."""
    less_is_better, difference = METRICS[name][1], after - before
    ratio = np.isfinite(log_half_width) & (np.abs(before) > FLOORS[name])
    change = np.where(
        ratio, np.log(np.where(ratio, after / np.where(ratio, before, 1.0), 1.0)), difference
    )
    unsure = np.where(np.isnan(half_width), LEAST_CHANGE * np.abs(before), half_width)
    same = (np.abs(difference) < FLOORS[name]) | (
        np.abs(change) <= np.where(ratio, log_half_width, unsure)
    )
    none = np.isnan(difference) | (less_is_better is None)
    return np.select([none, same, (difference < 0.0) == less_is_better], ["", SAME, BETTER], WORSE)


def write_seeds(path: Path, runs: Sequence[Summary]) -> None:
    """One line per run: how it ended, and all its metrics; whole or not at all."""
    with atomic_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*FACTS, *METRICS])
        for run in runs:
            writer.writerow(
                [
                    *(_cell(getattr(run, name)) for name in FACTS),
                    *(_cell(run.metrics[name]) for name in METRICS),
                ]
            )


def _cell(value: Any) -> Any:
    if isinstance(value, tuple):
        return BETWEEN.join(value)
    return "" if isinstance(value, float) and math.isnan(value) else value


def read_seeds(path: Path) -> dict[str, list[Summary]]:
    """The runs of seeds.csv, by control. Raises HexapodError when it is missing or damaged."""
    fix = "run `hexapod compare` again"
    runs: dict[str, list[Summary]] = {}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                runs.setdefault(row["control"], []).append(_summary(row))
    except OSError as error:
        raise HexapodError(
            "no runs by seed",
            got=error.strerror,
            expected=f"{SEEDS} of a comparison",
            fix=fix,
            where=str(path),
        ) from error
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        expected = "a line per run, with all metrics"
        raise HexapodError(
            "damaged file",
            got=f"{type(error).__name__}: {error}",
            expected=expected,
            fix=fix,
            where=str(path),
        ) from error
    return runs


def _summary(row: Mapping[str, str]) -> Summary:
    return Summary(
        control=row["control"],
        seed=int(row["seed"]),
        status=row["status"],
        reason=row["reason"],
        upright=row["upright"] == str(True),
        fallback=_number(row["fallback"]) if row["fallback"] else None,
        warnings=tuple(filter(None, row["warnings"].split(BETWEEN))),
        metrics={
            name: _number(row.get(name) or "") for name in METRICS
        },  # files of earlier versions have fewer
    )


def _number(text: str) -> float:
    return float(text) if text else math.nan
