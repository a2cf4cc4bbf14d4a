"""Draws parallel coordinates of a study: factors, slip and cost, with a line for each point."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from hexapod_cosim.cosim.results.metrics import FLOORS
from hexapod_cosim.cosim.study.plan.records import Factor, Study
from hexapod_cosim.cosim.study.report.style import (
    COLOURMAP,
    COST,
    SLIP,
    Array,
    label_of,
    logarithmic,
    mean_of,
    named,
    place_of,
    some_of,
)
from hexapod_cosim.cosim.study.store.table import Point

RESULT_AXES = 2  # the last axes: slip and cost


def parallel(points: Sequence[Point], study: Study) -> Figure:
    """Draws a panel for each control, with an axis for each factor that varies, slip and cost.

    Points without slip or cost are grey dashed lines that end at the last factor.
    """
    factors = [factor for factor in study.factors if len(set(factor.values)) != 1] or list(
        study.factors
    )
    controls = study.run_controls
    chosen = some_of(
        [point for point in points if not point.held_out and None not in point.values.values()]
    )
    places = [
        tuple(place_of(factor, point.values[factor.name]) for factor in factors) for point in chosen
    ]
    rows = [
        [
            (*place, _log_slip(mean_of(point, control, SLIP)), mean_of(point, control, COST))
            for point, place in zip(chosen, places, strict=True)
        ]
        for control in controls
    ]
    table = np.array(rows, dtype=np.float64).reshape(
        len(controls), len(chosen), len(factors) + RESULT_AXES
    )
    low, high = (limit(table, np.isfinite(table)) for limit in (_least, _largest))
    scaled = np.where(
        high > low,
        (table - low) / np.where(high > low, high - low, 1.0),
        np.where(np.isfinite(table), 0.5, math.nan),
    )
    figure = Figure(figsize=(max(1.5 * (len(factors) + 3), 7.0), 2.9 * len(controls) + 0.5))
    panels = np.atleast_1d(figure.subplots(len(controls), 1))
    for axes, control, lines in zip(panels, controls, scaled, strict=True):
        ran = np.array([point.runs[control] > 0 for point in chosen], dtype=np.bool_)
        collection = _lines(axes, lines[ran], (low[-RESULT_AXES], high[-RESULT_AXES]))
        _axes(axes, control, factors, (low, high))
    figure.colorbar(collection, ax=list(panels), label="slip [m/m]", shrink=0.7)
    return figure


def _least(table: Array, known: Array) -> Array:
    """Returns the least known value of each axis; NaN where there is none."""
    least = np.where(known, table, math.inf).min(axis=(0, 1), initial=math.inf)
    return np.where(np.isfinite(least), least, math.nan)


def _largest(table: Array, known: Array) -> Array:
    return -_least(-table, known)


def _lines(axes: Axes, lines: Array, log_slips: tuple[float, float]) -> LineCollection:
    """Draws lines (points, axes) of values scaled to 0 .. 1; returns those with a colour."""
    count, (low, high) = lines.shape[1], log_slips
    complete = np.isfinite(lines).all(axis=1)
    whole, ended = lines[complete], lines[~complete, :-RESULT_AXES]
    whole = whole[np.argsort(-whole[:, -RESULT_AXES])]  # little slip on top
    slips = 10.0 ** (
        whole[:, -RESULT_AXES] * (high - low) + low if high > low else np.full(len(whole), low)
    )
    axes.add_collection(
        LineCollection(
            [np.column_stack([np.arange(count - RESULT_AXES), line]) for line in ended],
            colors="0.55",
            linewidth=0.8,
            linestyle="--",
        )
    )
    paths = [np.column_stack([np.arange(count), line]) for line in whole]
    norm = logarithmic(10.0 ** np.array(log_slips))
    collection = LineCollection(
        paths, array=slips, cmap=COLOURMAP, norm=norm, linewidth=0.9, alpha=0.75
    )
    axes.add_collection(collection)
    return collection


def _axes(axes: Axes, control: str, factors: Sequence[Factor], limits: tuple[Array, Array]) -> None:
    """Draws the axes, whose lowest and highest values are `limits`."""
    low, high = limits
    count = len(low)
    axes.set(xlim=(-0.15, count - 0.85), ylim=(-0.12, 1.12), yticks=[])
    axes.set_title(control, pad=10)
    names = [label_of(factor).replace(" [", "\n[") for factor in factors]
    axes.set_xticks(range(count), [*names, "slip\n[m/m]", "cost of\ntransport"])
    axes.tick_params(length=0)
    axes.grid(visible=False)
    for side in ("left", "bottom", "top", "right"):
        axes.spines[side].set_visible(False)
    for place in range(count):
        axes.plot([place, place], [0.0, 1.0], color="0.6", linewidth=0.8, zorder=0)
        ends = (
            (10.0 ** low[place], 10.0 ** high[place])
            if place == count - RESULT_AXES
            else (low[place], high[place])
        )
        _ends(
            axes,
            place,
            factors[place] if place < len(factors) else None,
            float(ends[0]),
            float(ends[1]),
        )


def _ends(axes: Axes, place: int, factor: Factor | None, low: float, high: float) -> None:
    """Labels the ends of an axis with numbers, or with the first and the last name."""
    if not math.isfinite(low):
        axes.text(
            place,
            0.5,
            "none",
            ha="center",
            va="center",
            fontsize=7,
            color="0.35",
            backgroundcolor="white",
        )
        return
    texts = (f"{low:.3g}", f"{high:.3g}")
    if factor is not None and named(factor):
        names = list(dict.fromkeys(map(str, factor.values)))
        texts = (names[int(low)], names[int(high)])
    ends = (
        ((-0.03, texts[0], "top"), (1.03, texts[1], "bottom"))
        if high > low
        else ((1.03, texts[0], "bottom"),)
    )
    for y, text, side in ends:
        axes.text(place, y, text, ha="center", va=side, fontsize=7, color="0.35")


def _log_slip(slip: float) -> float:
    """Returns log10 of a slip: compliant walks slip decades less than kinematic ones."""
    return math.log10(max(slip, FLOORS[SLIP])) if math.isfinite(slip) else math.nan
