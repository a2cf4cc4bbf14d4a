"""Draws the figures of a study's report and saves them.

Colour-blind readers can distinguish the colours, and marks differ in shape as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import SETTINGS
from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.report.figures import Figures, figure_files, write_figures
from hexapod_cosim.cosim.results.metric_table import FLOORS, METRICS
from hexapod_cosim.extensions.study.records import GRID, Factor, Study, shown_value
from hexapod_cosim.extensions.study.summary import Point, Results
from hexapod_cosim.models.arrays import Array

SLIP = "slip_per_metre"
MAX_CELLS = 40  # more make a figure slower and no clearer
MAX_PANELS, COLUMNS = 9, 3  # panels, and panels side by side
EMPTY = "0.85"  # grey of cells without a value


class Drawing(NamedTuple):
    """A figure with the name of its files, title and caption."""

    name: str
    title: str
    caption: str
    draw: Callable[[], Figure]


def drawing_of(results: Results) -> Drawing | None:
    """Returns the figure that a study's points allow, or None."""
    study, points = results.study, results.points
    if study.optimise is not None:
        caption = (
            f"Mean {study.optimise.metric} of each trial over its training runs, and the best "
            "so far; dashed: before the optimisation."
        )
        drawing = Drawing("history", "Optimisation", caption, partial(history, results))
        return drawing if results.optimum else None
    means = [point.figures.means[name][SLIP].value for point in points for name in study.controls]
    varied = [factor for factor in study.factors if len(set(factor.values)) != 1]
    if not varied or not np.isfinite(means).any():
        return None
    small = all(len(factor.values) <= MAX_CELLS for factor in varied)
    if study.design == GRID and len(varied) == len(study.factors) == 2 and small:
        caption = "Mean slip per metre. Grey: no run (no pair) with a figure."
        draw = partial(heat_map, points, study)
        return Drawing("heat_map", " and ".join(f.name for f in varied), caption, draw)
    bars = "; bars: Student's 95 % intervals over seeds" if len(study.seeds) > 1 else ""
    caption = f"Mean slip per metre of each point over each factor by itself{bars}."
    draw = partial(over_factors, points, varied[:MAX_PANELS], study)
    return Drawing("effects", "Slip over each factor", caption, draw)


def save(drawing: Drawing, folder: Path) -> list[Path]:
    """Writes a figure as SVG and PNG; returns the files."""
    with matplotlib.rc_context(SETTINGS):
        files = figure_files(drawing.draw())
        images = {f"{drawing.name}.{kind}": content for kind, content in files}
    return write_figures(Figures(images, {}), folder)


def over_factors(points: Sequence[Point], factors: Sequence[Factor], study: Study) -> Figure:
    """Draws the slip over a factor in each panel, with a mark and an interval for each point."""
    columns = min(len(factors), COLUMNS)
    rows = math.ceil(len(factors) / columns)
    figure = Figure(figsize=(3.6 * columns + 0.6, 2.7 * rows + 0.5))
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, factor in zip(panels, factors, strict=False):
        _draw_effect(axes, points, factor, study)
        axes.set(xlabel=factor.label, ylabel="slip [m/m]")
        axes.margins(x=0.05, y=0.12)
    for axes in panels[len(factors) :]:
        axes.set_visible(False)
    panels[0].legend(fontsize=7)
    return figure


def _draw_effect(axes: Axes, points: Sequence[Point], factor: Factor, study: Study) -> None:
    """Draws a mark for each point and control; names and booleans are placed side by side."""
    names = list(dict.fromkeys(factor.values))
    named = any(isinstance(value, str | bool) for value in names)
    values = [point.values[factor.name] for point in points]
    place = np.array([names.index(value) if named else value for value in values], dtype=float)
    for control, style in control_styles(study.controls).items():
        means = [point.figures.means[control][SLIP] for point in points]
        axes.errorbar(
            place,
            [item.value for item in means],
            np.nan_to_num([item.half_width for item in means]),
            linestyle="",
            marker=style.marker,
            markersize=4,
            alpha=0.7,
            capsize=2.5,
            color=style.light,
            label=control,
        )
    if named:
        axes.set_xticks(range(len(names)), list(map(shown_value, names)), rotation=20)


def heat_map(points: Sequence[Point], study: Study) -> Figure:
    """Draws the slip over two factors for each control, and the changes from the first one."""
    first, second = study.factors
    before, *others = study.controls
    slips = {
        name: _cells(points, study, [p.figures.means[name][SLIP].value for p in points])
        for name in study.controls
    }
    seen = np.clip(np.concatenate(list(slips.values()), axis=None), FLOORS[SLIP], None)
    norm = LogNorm(float(np.nanmin(seen)), float(np.nanmax(seen)) * (1.0 + 1e-9))
    panels: list[tuple[str, Array, Normalize, str]]
    panels = [(f"{name}, slip [m/m]", values, norm, "viridis") for name, values in slips.items()]
    for name in others:
        changes = [100.0 * point.figures.changes[name][SLIP].relative for point in points]
        cells, apart = _cells(points, study, changes), Normalize(-100.0, 100.0)
        panels.append((f"{before} → {name}, pairs [%]", cells, apart, "RdBu_r"))
    height = 0.42 * min(max(len(second.values), 3), 12) + 2.2
    figure = Figure(figsize=(3.6 * len(panels) + 0.8, height))
    for axes, (title, values, scale, colours) in zip(
        np.atleast_1d(figure.subplots(1, len(panels), sharey=True)), panels, strict=True
    ):
        axes.set(title=title, xlabel=first.label, facecolor=EMPTY)
        axes.grid(visible=False)
        image = axes.imshow(values, origin="lower", aspect="auto", cmap=colours, norm=scale)
        labels = list(map(shown_value, first.values))
        axes.set_xticks(range(len(labels)), labels, rotation=45 if len(labels) > 6 else 0)
        axes.set_yticks(range(len(second.values)), list(map(shown_value, second.values)))
        figure.colorbar(image, ax=axes, shrink=0.9)
    figure.axes[0].set_ylabel(second.label)
    return figure


def _cells(points: Sequence[Point], study: Study, values: Sequence[float]) -> Array:
    """Returns the values of points by the second and the first factor; NaN where there is none."""
    first, second = study.factors
    cells = np.full((len(second.values), len(first.values)), math.nan)
    for point, value in zip(points, values, strict=True):
        row = second.values.index(point.values[second.name])
        cells[row, first.values.index(point.values[first.name])] = value
    return cells


def history(results: Results) -> Figure:
    """Draws the objective of each trial, the best so far, and the value before."""
    asked, optimum = results.study.optimise, results.optimum
    assert asked is not None
    assert optimum is not None
    unit, less, _ = METRICS[asked.metric]
    figure = Figure(figsize=(8.0, 3.4))
    axes = figure.subplots()
    values = np.array([trial["means"][asked.metric] for trial in optimum["trials"]], dtype=float)
    feasible = np.array([trial["feasible"] for trial in optimum["trials"]])
    numbers = np.arange(len(values))
    axes.plot(numbers[feasible], values[feasible], "o", color="#0072B2", label="trial")
    axes.plot(numbers[~feasible], values[~feasible], "x", color="0.55", label="breaks a constraint")
    best = (np.fmin if less else np.fmax).accumulate(values[feasible])
    axes.step(numbers[feasible], best, where="post", color="#009E73", label="best so far")
    before = optimum["before"]["training"][asked.metric]
    if before is not None:
        axes.axhline(before, color="#D55E00", linestyle="--", linewidth=1.2, label="before")
    axes.set(xlabel="trial", ylabel=f"{asked.metric} [{unit}]", xlim=(-0.5, len(values) - 0.5))
    figure.legend(loc="outside upper center", ncols=5)
    return figure
