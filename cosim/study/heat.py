"""Draws the heat map of a grid's first two factors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.metrics import FLOORS
from hexapod_cosim.cosim.study.groups import Point
from hexapod_cosim.cosim.study.records import Factor, Study

Array = NDArray[np.float64]
SLIP = "slip_per_metre"
COLOURMAP, CHANGES = "viridis", "RdBu_r"
MAX_NUMBERED = 60  # cells that show their values as numbers
GREY = "0.5"


@dataclass(frozen=True)
class _Panel:
    """A panel with arrays by cell (values of the second factor, values of the first)."""

    title: str
    values: Array  # NaN in cells without one
    runs: Array  # numbers of runs
    walked: Array  # numbers of walks
    norm: Normalize
    colours: str


def mean_of(point: Point, control: str, metric: str) -> float:
    """Returns the mean of a metric at a point, NaN where there is none."""
    return point.figures.means[control][metric].value


def label_of(factor: Factor) -> str:
    """Returns the name of a factor with its unit."""
    unit = "x designed" if factor.relative else factor.unit
    return f"{factor.name} [{unit}]" if unit else factor.name


def ticks_of(factor: Factor) -> list[str]:
    """Returns the different values of a factor as labels."""
    return [
        f"{value:.4g}" if isinstance(value, float) else str(value)
        for value in dict.fromkeys(factor.values)
    ]


def heat_map(points: Sequence[Point], first: Factor, second: Factor, study: Study) -> Figure:
    """Draws the slip over two factors for each control, and the changes from the first one."""
    cells = _Cells(points, first, second)
    controls = study.run_controls
    slips = [cells.mean(partial(_slip, control)) for control in controls]
    norm = _logarithmic(np.concatenate(slips, axis=None))
    panels = [
        _Panel(
            f"{control}, slip [m/m]",
            values,
            cells.total("runs", control),
            cells.total("walked", control),
            norm,
            COLOURMAP,
        )
        for control, values in zip(controls, slips, strict=True)
    ]
    panels += [
        _Panel(
            f"{controls[0]} → {control}, pairs [%]",
            100.0 * (cells.mean(partial(_change, control)) - 1.0),
            # a cell has no pairs to show yet, or none as one control never walked
            cells.total("pairs", control) + cells.lost(controls[0]) + cells.lost(control),
            cells.total("pairs", control),
            Normalize(-100.0, 100.0),
            CHANGES,
        )
        for control in controls[1:]
    ]
    figure = Figure(
        figsize=(3.6 * len(panels) + 0.8, 0.42 * min(max(len(second.values), 3), 12) + 2.2)
    )
    axes = np.atleast_1d(figure.subplots(1, len(panels), sharey=True))
    for one, panel in zip(axes, panels, strict=True):
        _draw(figure, one, panel, first, second)
    figure.axes[0].set_ylabel(label_of(second))
    return figure


def _logarithmic(slips: Array) -> LogNorm:
    """Returns the logarithmic colour scale of slips."""
    seen = np.clip(slips[np.isfinite(slips)], FLOORS[SLIP], None)
    low, high = (float(seen.min()), float(seen.max())) if len(seen) else (FLOORS[SLIP], 1.0)
    return LogNorm(low, high * (1.0 + 1e-9))


def _slip(control: str, point: Point) -> tuple[float, float]:
    return mean_of(point, control, SLIP), 1.0


def _change(control: str, point: Point) -> tuple[float, float]:
    """Returns the slips after and before the change to a control."""
    change = point.figures.changes[control][SLIP]
    return change.after, change.before


class _Cells:
    """Points by the values of two factors."""

    def __init__(self, points: Sequence[Point], first: Factor, second: Factor) -> None:
        self._shape = len(second.values), len(first.values)
        across = {value: place for place, value in enumerate(first.values)}
        up = {value: place for place, value in enumerate(second.values)}
        self._points = [
            ((up[point.values[second.name]], across[point.values[first.name]]), point)
            for point in points
        ]

    def mean(self, figures: Callable[[Point], tuple[float, float]]) -> Array:
        """Returns the ratio of sums over the points of each cell; NaN where there is none.

        `figures` returns the numerator and the denominator of a point.
        """
        above, below = np.zeros(self._shape), np.zeros(self._shape)
        for place, point in self._points:
            pair = figures(point)
            if all(map(math.isfinite, pair)):
                above[place] += pair[0]
                below[place] += pair[1]
        return np.asarray(
            np.divide(above, below, out=np.full(self._shape, math.nan), where=below > 0.0)
        )

    def total(self, kind: str, control: str) -> Array:
        """Returns the sum of runs, walked or pairs of a control over the points of each cell."""
        found = np.zeros(self._shape)
        for place, point in self._points:
            found[place] += getattr(point.figures, kind)[control]
        return found

    def lost(self, control: str) -> Array:
        """Returns whether a control has runs in a cell and none that walked."""
        return np.asarray((self.total("runs", control) > 0) & (self.total("walked", control) == 0))


def _draw(figure: Figure, axes: Axes, panel: _Panel, first: Factor, second: Factor) -> None:
    """Draws a panel, with a mark in cells without a value.

    The mark is a dot where nothing was run yet, a cross where no run walked, and a dash where the
    walk has no value.
    """
    axes.set_title(panel.title)
    axes.grid(visible=False)
    image = axes.imshow(
        panel.values,
        origin="lower",
        aspect="auto",
        cmap=panel.colours,
        norm=panel.norm,
        interpolation="nearest",
    )
    for row, column in np.argwhere(~np.isfinite(panel.values)):
        mark = "." if not panel.runs[row, column] else "x" if not panel.walked[row, column] else "_"
        axes.plot(column, row, marker=mark, color=GREY)
    if panel.values.size <= MAX_NUMBERED:
        _numbers(axes, panel.values, image)
    axes.set_xticks(
        range(len(first.values)), ticks_of(first), rotation=45 if len(first.values) > 6 else 0
    )
    axes.set_yticks(range(len(second.values)), ticks_of(second))
    axes.set_xlabel(label_of(first))
    figure.colorbar(image, ax=axes, shrink=0.9)


def _numbers(axes: Axes, values: Array, image: Any) -> None:
    for (row, column), value in np.ndenumerate(values):
        if math.isfinite(value):
            red, green, blue, _ = image.cmap(image.norm(value))
            light = 0.299 * red + 0.587 * green + 0.114 * blue > 0.55
            axes.text(
                column,
                row,
                f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}",
                ha="center",
                va="center",
                fontsize=7.5,
                color="black" if light else "white",
            )
