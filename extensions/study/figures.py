"""Draws the figures of a study's report and saves them.

Colour-blind readers can distinguish the colours, and marks differ in shape as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hexapod_cosim.controller.figure_style import SETTINGS
from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.report.figures import Figures, figure_files, write_figures
from hexapod_cosim.cosim.results.metric_table import FLOORS, METRICS
from hexapod_cosim.extensions.study.groups import Point
from hexapod_cosim.extensions.study.records import GRID, VALUES, Factor, Study
from hexapod_cosim.extensions.study.search import Trial
from hexapod_cosim.extensions.study.summary import Results
from hexapod_cosim.extensions.study.tables import label_of, shown_value

Array = NDArray[np.float64]
SLIP = "slip_per_metre"
MAX_CELLS = 40  # more make a figure slower and no clearer
MAX_PANELS, COLUMNS = 9, 3  # panels, and panels side by side
EMPTY = "0.85"  # grey of cells without a value


@dataclass(frozen=True)
class Drawing:
    """A figure with its title and caption."""

    title: str
    caption: str
    draw: Callable[[], Figure]


def drawings(results: Results, *, before: float = math.nan) -> dict[str, Drawing]:
    """Returns the figures that a study's points allow, by the names of their files.

    Args:
        before: the first objective before the optimisation, NaN without one.
    """
    study = results.study
    points = [point for point in results.points if not point.held_out]
    if study.optimise is not None and results.trials:
        caption = (
            f"Mean {study.optimise.metrics[0]} of each trial over its training runs, and the best "
            "so far; dashed: before the optimisation."
        )
        draw = partial(history, study, results.trials, before)
        return {"history": Drawing("Optimisation", caption, draw)}
    means = [point.figures.means[name][SLIP].value for point in points for name in study.controls]
    return _of_factors(study, points) if np.isfinite(means).any() else {}


def _of_factors(study: Study, points: Sequence[Point]) -> dict[str, Drawing]:
    """Returns the figure over two factors of a grid, or over each factor."""
    varied = [factor for factor in study.factors if len(set(factor.values)) != 1]
    axes = [factor for factor in varied if factor.kind == VALUES]
    axes = [factor for factor in axes if len(factor.values) <= MAX_CELLS]
    if study.design == GRID and len(axes) >= 2:
        averaged = ", averaged over the others" if len(study.factors) > 2 else ""
        caption = f"Mean slip per metre{averaged}. Grey: no run (no pair) with a figure."
        draw = partial(heat_map, points, axes[0], axes[1], study)
        return {"heat_map": Drawing(f"{axes[0].name} and {axes[1].name}", caption, draw)}
    if not varied:
        return {}
    bars = "; bars: Student's 95 % intervals over seeds" if len(study.seeds) > 1 else ""
    caption = f"Mean slip per metre of each point over each factor by itself{bars}."
    draw = partial(over_factors, points, varied[:MAX_PANELS], study)
    return {"effects": Drawing("Slip over each factor", caption, draw)}


def save(found: dict[str, Drawing], folder: Path) -> list[Path]:
    """Writes every figure as SVG and PNG; returns the files."""
    images: dict[str, bytes] = {}
    with matplotlib.rc_context(SETTINGS):
        for name, item in found.items():
            files = figure_files(item.draw())
            images |= {f"{name}.{kind}": content for kind, content in files}
    return write_figures(Figures(images, {}), folder)


def over_factors(points: Sequence[Point], factors: Sequence[Factor], study: Study) -> Figure:
    """Draws the slip over a factor in each panel, with a mark and an interval for each point."""
    columns = min(len(factors), COLUMNS)
    rows = math.ceil(len(factors) / columns)
    figure = Figure(figsize=(3.6 * columns + 0.6, 2.7 * rows + 0.5))
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, factor in zip(panels, factors, strict=False):
        _draw_effect(axes, points, factor, study)
        axes.set(xlabel=label_of(factor), ylabel="slip [m/m]")
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


def heat_map(points: Sequence[Point], first: Factor, second: Factor, study: Study) -> Figure:
    """Draws the slip over two factors for each control, and the changes from the first one."""
    before, *others = study.controls
    slips = {
        control: _cells(points, first, second, partial(_mean_of, control))
        for control in study.controls
    }
    seen = np.clip(np.concatenate(list(slips.values()), axis=None), FLOORS[SLIP], None)
    norm = LogNorm(float(np.nanmin(seen)), float(np.nanmax(seen)) * (1.0 + 1e-9))
    panels: list[tuple[str, Array, Normalize, str]]
    panels = [(f"{name}, slip [m/m]", values, norm, "viridis") for name, values in slips.items()]
    for control in others:
        ratio = _cells(points, first, second, partial(_pair_of, control))
        apart = Normalize(-100.0, 100.0)
        panels.append((f"{before} → {control}, pairs [%]", 100.0 * (ratio - 1.0), apart, "RdBu_r"))
    height = 0.42 * min(max(len(second.values), 3), 12) + 2.2
    figure = Figure(figsize=(3.6 * len(panels) + 0.8, height))
    for axes, (title, values, scale, colours) in zip(
        np.atleast_1d(figure.subplots(1, len(panels), sharey=True)), panels, strict=True
    ):
        axes.set(title=title, xlabel=label_of(first), facecolor=EMPTY)
        axes.grid(visible=False)
        image = axes.imshow(values, origin="lower", aspect="auto", cmap=colours, norm=scale)
        rotation = 45 if len(first.values) > 6 else 0
        axes.set_xticks(
            range(len(first.values)), list(map(shown_value, first.values)), rotation=rotation
        )
        axes.set_yticks(range(len(second.values)), list(map(shown_value, second.values)))
        figure.colorbar(image, ax=axes, shrink=0.9)
    figure.axes[0].set_ylabel(label_of(second))
    return figure


def _mean_of(control: str, point: Point) -> tuple[float, float]:
    """Returns the mean over a point's walks, over 1."""
    return point.figures.means[control][SLIP].value, 1.0


def _pair_of(control: str, point: Point) -> tuple[float, float]:
    """Returns the means over a point's pairs under a control and under the reference."""
    change = point.figures.changes[control][SLIP]
    return change.after, change.before


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


def history(study: Study, trials: Sequence[Trial], before: float) -> Figure:
    """Draws the first metric of each trial, the best so far, and the value before."""
    assert study.optimise is not None
    name = study.optimise.metrics[0]
    unit, less, _ = METRICS[name]
    figure = Figure(figsize=(8.0, 3.4))
    axes = figure.subplots()
    for feasible, mark, colour, label in (
        (True, "o", "#0072B2", "trial"),
        (False, "x", "0.55", "breaks a constraint"),
    ):
        shown = [trial for trial in trials if trial.feasible is feasible]
        numbers, values = (
            [trial.number for trial in shown],
            [trial.means[name] for trial in shown],
        )
        axes.plot(numbers, values, mark, color=colour, label=label)
        if feasible and shown:
            best = (np.fmin if less else np.fmax).accumulate(values)
            axes.step(numbers, best, where="post", color="#009E73", label="best so far")
    if math.isfinite(before):
        axes.axhline(before, color="#D55E00", linestyle="--", linewidth=1.2, label="before")
    last = max(study.optimise.trials - 0.5, 0.5)
    axes.set(xlabel="trial", ylabel=f"{name} [{unit}]", xlim=(-0.5, last))
    figure.legend(loc="outside upper center", ncols=5)
    return figure
