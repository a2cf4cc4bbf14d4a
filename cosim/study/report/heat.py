"""Draws the heat map of a grid's first two factors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from hexapod_cosim.cosim.study.plan.records import Factor, Study
from hexapod_cosim.cosim.study.report.style import (
    CHANGES,
    COLOURMAP,
    SLIP,
    Array,
    label_of,
    logarithmic,
    mean_of,
    ticks_of,
)
from hexapod_cosim.cosim.study.store.table import Point

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


def heat_map(points: Sequence[Point], first: Factor, second: Factor, study: Study) -> Figure:
    """Draws the slip over two factors for each control, and the changes from the first one."""
    cells = _Cells(points, first, second)
    controls = study.run_controls
    slips = [cells.mean(_slip(control)) for control in controls]
    norm = logarithmic(np.concatenate(slips, axis=None))
    panels = [
        _Panel(
            f"{control}, slip [m/m]",
            values,
            cells.total(_runs(control)),
            cells.total(_walked(control)),
            norm,
            COLOURMAP,
        )
        for control, values in zip(controls, slips, strict=True)
    ]
    panels += [
        _Panel(
            f"{controls[0]} → {control}, pairs [%]",
            100.0 * (cells.mean(_change(control)) - 1.0),
            cells.total(_pairs_known(controls[0], control)),
            cells.total(_pairs(control)),
            Normalize(-100.0, 100.0),
            CHANGES,
        )
        for control in controls[1:]
    ]
    figure = Figure(
        figsize=(3.6 * len(panels) + 0.8, 0.42 * min(max(len(second.values), 3), 12) + 2.2)
    )
    for axes, panel in zip(
        np.atleast_1d(figure.subplots(1, len(panels), sharey=True)), panels, strict=True
    ):
        _draw(figure, axes, panel, first, second)
    figure.axes[0].set_ylabel(label_of(second))
    return figure


def _slip(control: str) -> Callable[[Point], tuple[float, float]]:
    return lambda point: (mean_of(point, control, SLIP), 1.0)


def _runs(control: str) -> Callable[[Point], int]:
    return lambda point: point.runs[control]


def _walked(control: str) -> Callable[[Point], int]:
    return lambda point: point.walked[control]


def _pairs(control: str) -> Callable[[Point], int]:
    return lambda point: point.pairs[control]


def _pairs_known(*controls: str) -> Callable[[Point], int]:
    """Returns > 0 when a point has pairs, or when it has none as one control never walked."""
    return lambda point: (
        point.pairs[controls[-1]]
        or int(any(point.runs[name] and not point.walked[name] for name in controls))
    )


def _change(control: str) -> Callable[[Point], tuple[float, float]]:
    return lambda point: (point.changes[control][SLIP].after, point.changes[control][SLIP].before)


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

    def total(self, figure: Callable[[Point], int]) -> Array:
        """Returns the sum over the points of each cell."""
        found = np.zeros(self._shape)
        for place, point in self._points:
            found[place] += figure(point)
        return found


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
