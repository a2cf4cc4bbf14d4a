"""Parallel coordinates of a study: an axis per factor, then slip and cost; a line per point and control."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from hexapod_cosim.cosim.metrics import FLOORS
from hexapod_cosim.cosim.study.marks import COLOURMAP, COST, SLIP, Array, label_of, logarithmic, mean_of, some_of
from hexapod_cosim.cosim.study.records import VALUES, Factor, Study
from hexapod_cosim.cosim.study.table import Point


def parallel(points: Sequence[Point], study: Study) -> Figure:
    """Parallel coordinates: an axis per factor, then slip and cost; a line per point and control."""
    factors, controls = study.factors, study.run_controls
    chosen = some_of([point for point in points if not point.held_out and None not in point.values.values()])
    figure = Figure(figsize=(max(1.5 * (len(factors) + 3), 7.0), 3.2 * len(controls) + 0.4))
    placed = [tuple(_place(factor, point) for factor in factors) for point in chosen]
    pairs = list(zip(chosen, placed, strict=True))
    rows = [
        [(*places, _decades(mean_of(point, control, SLIP)), mean_of(point, control, COST)) for point, places in pairs]
        for control in controls
    ]
    table = np.array(rows, dtype=np.float64).reshape(len(controls), len(chosen), len(factors) + 2)
    low, high = np.nanmin(table, axis=(0, 1)), np.nanmax(table, axis=(0, 1))
    scaled = (table - low) / np.where(high > low, high - low, 1.0)
    panels = np.atleast_1d(figure.subplots(len(controls), 1))
    for axes, control, lines in zip(panels, controls, scaled, strict=True):
        _coordinates(figure, axes, lines, control, factors, (low, high))
    return figure


def _coordinates(figure: Figure, axes: Axes, lines: Array, control: str, factors: Sequence[Factor], limits: tuple[Array, Array]) -> None:
    count, (low, high) = lines.shape[1], limits
    whole = lines[np.isfinite(lines).all(axis=1)]
    whole = whole[np.argsort(-whole[:, -2])]  # little slip on top
    paths = [np.column_stack([np.arange(count), line]) for line in whole]
    slips = 10.0 ** (whole[:, -2] * (high[-2] - low[-2]) + low[-2])
    norm = logarithmic(10.0 ** np.array([low[-2], high[-2]]))
    collection = LineCollection(paths, array=slips, cmap=COLOURMAP, norm=norm, linewidth=0.9, alpha=0.7)
    axes.add_collection(collection)
    axes.set(xlim=(-0.15, count - 0.85), ylim=(-0.08, 1.08), title=control, yticks=[])
    axes.set_xticks(range(count), [*(label_of(factor).replace(" [", "\n[") for factor in factors), "slip\n[m/m]", "cost of\ntransport"])
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)
    for place in range(count):
        axes.axvline(place, color="0.6", linewidth=0.8, zorder=0)
        ends = (10.0 ** low[place], 10.0 ** high[place]) if place == count - 2 else (low[place], high[place])
        _ends(axes, place, factors[place] if place < len(factors) else None, float(ends[0]), float(ends[1]))
    figure.colorbar(collection, ax=axes, label="slip [m/m]", shrink=0.9)


def _ends(axes: Axes, place: int, factor: Factor | None, low: float, high: float) -> None:
    """What the ends of an axis mean: numbers, or the first and last of names."""
    texts = (f"{low:.3g}", f"{high:.3g}")
    if factor is not None and _is_named(factor):
        texts = (str(factor.values[int(low)]), str(factor.values[int(high)]))
    for y, text, side in ((-0.02, texts[0], "top"), (1.02, texts[1], "bottom")):
        axes.text(place, y, text, ha="center", va=side, fontsize=7, color="0.35")


def _decades(slip: float) -> float:
    """Its logarithm: compliant walks slip decades less than kinematic ones."""
    return math.log10(max(slip, FLOORS[SLIP])) if math.isfinite(slip) else math.nan


def _is_named(factor: Factor) -> bool:
    return factor.kind == VALUES and not all(isinstance(value, int | float) and not isinstance(value, bool) for value in factor.values)


def _place(factor: Factor, point: Point) -> float:
    value = point.values[factor.name]
    return float(factor.values.index(value)) if _is_named(factor) else float(value)
