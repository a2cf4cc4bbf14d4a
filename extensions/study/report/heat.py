"""Draws the heat map of a grid's first two factors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.metric_table import FLOORS
from hexapod_cosim.extensions.study.groups import Point
from hexapod_cosim.extensions.study.records import Factor, Study
from hexapod_cosim.extensions.study.report.tables import label_of

Array = NDArray[np.float64]
SLIP = "slip_per_metre"
COLOURMAP, CHANGES = "viridis", "RdBu_r"
EMPTY = "0.85"  # grey of cells without a value


def mean_of(point: Point, control: str, metric: str) -> float:
    """Returns the mean of a metric at a point, NaN where there is none."""
    return point.figures.means[control][metric].value


def ticks_of(factor: Factor) -> list[str]:
    """Returns the different values of a factor as labels."""
    return [
        f"{value:.4g}" if isinstance(value, float) else str(value)
        for value in dict.fromkeys(factor.values)
    ]


def heat_map(points: Sequence[Point], first: Factor, second: Factor, study: Study) -> Figure:
    """Draws the slip over two factors for each control, and the changes from the first one."""

    def slip(control: str) -> Array:
        return _cells(points, first, second, lambda point: (mean_of(point, control, SLIP), 1.0))

    def change(control: str) -> Array:
        def slips(point: Point) -> tuple[float, float]:
            pairs = point.figures.changes[control][SLIP]
            return pairs.after, pairs.before

        return 100.0 * (_cells(points, first, second, slips) - 1.0)

    before, *others = study.controls
    slips = {control: slip(control) for control in study.controls}
    norm = _logarithmic(np.concatenate(list(slips.values()), axis=None))
    panels: list[tuple[str, Array, Normalize, str]]
    panels = [(f"{name}, slip [m/m]", values, norm, COLOURMAP) for name, values in slips.items()]
    apart = Normalize(-100.0, 100.0)
    panels += [(f"{before} → {name}, pairs [%]", change(name), apart, CHANGES) for name in others]
    height = 0.42 * min(max(len(second.values), 3), 12) + 2.2
    figure = Figure(figsize=(3.6 * len(panels) + 0.8, height))
    for axes, (title, values, scale, colours) in zip(
        np.atleast_1d(figure.subplots(1, len(panels), sharey=True)), panels, strict=True
    ):
        axes.set(title=title, xlabel=label_of(first), facecolor=EMPTY)
        axes.grid(visible=False)
        image = axes.imshow(values, origin="lower", aspect="auto", cmap=colours, norm=scale)
        rotation = 45 if len(first.values) > 6 else 0
        axes.set_xticks(range(len(first.values)), ticks_of(first), rotation=rotation)
        axes.set_yticks(range(len(second.values)), ticks_of(second))
        figure.colorbar(image, ax=axes, shrink=0.9)
    figure.axes[0].set_ylabel(label_of(second))
    return figure


def _cells(
    points: Sequence[Point],
    first: Factor,
    second: Factor,
    pair_of: Callable[[Point], tuple[float, float]],
) -> Array:
    """Returns the ratio of sums over the points of each cell; NaN where there is none.

    `pair_of` returns the numerator and the denominator of a point.
    """
    sums = np.zeros((2, len(second.values), len(first.values)))
    for point in points:
        pair = pair_of(point)
        if all(map(math.isfinite, pair)):
            row = second.values.index(point.values[second.name])
            sums[:, row, first.values.index(point.values[first.name])] += pair
    above, below = sums
    return np.divide(above, below, out=np.full_like(above, math.nan), where=below > 0.0)


def _logarithmic(slips: Array) -> LogNorm:
    """Returns the logarithmic colour scale of slips."""
    seen = np.clip(slips[np.isfinite(slips)], FLOORS[SLIP], None)
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (FLOORS[SLIP], 1.0)
    return LogNorm(low, high * (1.0 + 1e-9))
