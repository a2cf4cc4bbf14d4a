"""Moments of samples, and the figures of points that are computed from them.

Moments are merged by the formulas of Chan, Golub and LeVeque (1983).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.comparison import Change, half_widths, log_half_widths, verdicts
from hexapod_cosim.cosim.results.metrics import FLOORS
from hexapod_cosim.extensions.study.store import FIGURES

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
SAMPLES = 3  # of a pair: the figures before and after, and their difference


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

    def merged(self) -> Moments:
        """Merges the samples along the first axis, which has one element then."""
        count = self.count.sum(axis=0, keepdims=True)
        mean = (self.count * self.mean).sum(axis=0, keepdims=True) / np.maximum(count, 1.0)
        apart = self.square + self.count * (self.mean - mean) ** 2
        return Moments(count, mean, apart.sum(axis=0, keepdims=True))


@dataclass(frozen=True, kw_only=True)
class Sums:
    """The sums of g groups of runs under c controls; a group is a point, or all runs."""

    runs: Numbers  # (g, c)
    walked: Numbers  # (g, c)
    pairs: Numbers  # (g, c - 1) pairs of which both runs walked to the end, by the other control
    means: Moments  # (g, c, metrics) of walks
    changes: Moments  # (g, c - 1, SAMPLES, metrics) of pairs


def merged(parts: Sequence[Sums]) -> Sums:
    """Returns the sums of one group, which consists of all groups of the parts."""

    def numbers(name: str) -> Numbers:
        found = np.concatenate([getattr(part, name) for part in parts])
        return np.asarray(found.sum(axis=0, keepdims=True))

    def moments(name: str) -> Moments:
        found = [getattr(part, name) for part in parts]
        names = ("count", "mean", "square")
        return Moments(*(np.concatenate([getattr(one, key) for one in found]) for key in names))

    return Sums(
        runs=numbers("runs"),
        walked=numbers("walked"),
        pairs=numbers("pairs"),
        means=moments("means").merged(),
        changes=moments("changes").merged(),
    )


@dataclass(frozen=True)
class Mean:
    """The mean of a metric over walks."""

    value: float  # NaN where no walk has the metric
    half_width: float  # of its 95 % interval; NaN for fewer than two walks
    runs: int


@dataclass(frozen=True, kw_only=True)
class Figures:
    """The figures of a group of runs."""

    runs: Mapping[str, int]  # numbers of runs by control
    walked: Mapping[str, int]  # numbers of walks by control
    # numbers of pairs with the first control, of which both runs walked to the end, by the other
    pairs: Mapping[str, int]
    means: Mapping[str, Mapping[str, Mean]]  # by control and metric
    # from the first control to each other one, by the other one and metric
    changes: Mapping[str, Mapping[str, Change]]


def figures_of(sums: Sums, controls: Sequence[str]) -> list[Figures]:
    """Returns the figures of each group."""
    means = [_means(sums.means[:, k]) for k in range(len(controls))]
    changes = [_changes(sums.changes[:, k]) for k in range(len(controls) - 1)]
    return [
        Figures(
            runs=dict(zip(controls, sums.runs[group].tolist(), strict=True)),
            walked=dict(zip(controls, sums.walked[group].tolist(), strict=True)),
            pairs=dict(zip(controls[1:], sums.pairs[group].tolist(), strict=True)),
            means={name: found[group] for name, found in zip(controls, means, strict=True)},
            changes={name: found[group] for name, found in zip(controls[1:], changes, strict=True)},
        )
        for group in range(len(sums.runs))
    ]


def _means(moments: Moments) -> list[dict[str, Mean]]:
    """Returns the means of each group by metric, from moments (g, metrics)."""
    parts = moments.value.tolist(), moments.half_width.tolist(), moments.count.astype(int).tolist()
    return [
        {name: Mean(*of_name) for name, *of_name in zip(FIGURES, *of_group, strict=True)}
        for of_group in zip(*parts, strict=True)
    ]


def _changes(moments: Moments) -> list[dict[str, Change]]:
    """Returns the changes of each group by metric, as `hexapod compare` computes them.

    moments: (g, SAMPLES, metrics) of pairs.
    """
    before, after, difference = (moments[:, k] for k in range(SAMPLES))
    squares = (before.square, after.square, difference.square)
    ratio = log_half_widths(difference.count, before.mean, after.mean, squares)
    parts = (before.value, after.value, difference.half_width, ratio)
    found: list[dict[str, Change]] = [{} for _ in moments.count]
    for k, name in enumerate(FIGURES):
        of_name = [part[:, k] for part in parts]
        columns = [*of_name, difference.count[:, k].astype(int), verdicts(name, *of_name)]
        for group, values in enumerate(zip(*(part.tolist() for part in columns), strict=True)):
            first, second, half, log_half, pairs, verdict = values
            found[group][name] = Change(
                before=first,
                after=second,
                half_width=half,
                log_half_width=log_half,
                pairs=pairs,
                floor=FLOORS[name],
                verdict=verdict,
            )
    return found
