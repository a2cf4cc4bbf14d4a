"""Figures of a study: what two factors do, all factors at once, slip against cost, and how an optimiser got where it got.

Colours are told apart by colour-blind readers, and marks by their shape too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import DPI, SETTINGS, UNDATED
from hexapod_cosim.cosim.files import atomic_path
from hexapod_cosim.cosim.metrics import METRICS
from hexapod_cosim.cosim.study.coordinates import parallel
from hexapod_cosim.cosim.study.marks import (
    CHANGES,
    COLOURMAP,
    COLOURS,
    COST,
    MARKS,
    MOST_CELLS,
    MOST_LINES,
    NAMES,
    SLIP,
    Array,
    label_of,
    logarithmic,
    mean_of,
)
from hexapod_cosim.cosim.study.optimise import Trial
from hexapod_cosim.cosim.study.records import VALUES, Factor, Study
from hexapod_cosim.cosim.study.table import Point
from hexapod_cosim.models import HexapodError


@dataclass(frozen=True)
class Drawing:
    """A figure with what to say about it."""

    title: str
    caption: str
    draw: Callable[[], Figure]


def drawings(study: Study, points: Sequence[Point], trials: Sequence[Trial], *, before: float = math.nan) -> dict[str, Drawing]:
    """The figures that a study's points allow, by the name of their files."""
    found: dict[str, Drawing] = {}
    axes = [factor for factor in study.factors if factor.kind == VALUES and 1 < len(factor.values) <= MOST_CELLS]
    if study.optimise is not None:
        caption = f"Mean {study.optimise.metrics[0]} of each trial on the training runs, and the best so far."
        found["history"] = Drawing("Optimisation", caption, partial(history, study, trials, before))
    elif len(axes) >= 2:
        caption = f"Mean slip per metre{', averaged over the others' if len(study.factors) > 2 else ''}; crossed: none walked to its end."
        found["heat_map"] = Drawing(f"{axes[0].name} and {axes[1].name}", caption, partial(heat_map, points, axes[0], axes[1], study))
    elif len(study.factors) == 1:
        caption = "Means over seeds; bands: their 95 % intervals."
        found["response"] = Drawing(study.factors[0].name, caption, partial(response, points, study.factors[0], study))
    if len(study.factors) > 1:
        found["parallel"] = Drawing(
            "All factors", "A line per point and control; colour: slip per metre.", partial(parallel, points, study)
        )
    caption = "A mark per point and control; lines: what no other point betters in both."
    found["pareto"] = Drawing("Slip against cost of transport", caption, partial(pareto, points, study))
    return found


def save(found: dict[str, Drawing], folder: Path) -> list[Path]:
    """Writes every figure as SVG and PNG."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise HexapodError("cannot write", got=error.strerror, where=str(folder)) from error
    files: list[Path] = []
    with matplotlib.rc_context(SETTINGS):
        for name, item in found.items():
            figure = item.draw()
            for kind, metadata in UNDATED.items():
                with atomic_path(folder / f"{name}.{kind}") as path:
                    figure.savefig(path, format=kind, dpi=DPI, metadata=metadata)
                figure.set_layout_engine("none")  # laid out once is enough: it takes as long as the drawing
                files.append(folder / f"{name}.{kind}")
    return files


def _ticks(factor: Factor) -> list[str]:
    return [f"{value:.4g}" if isinstance(value, float) else str(value) for value in factor.values]


def heat_map(points: Sequence[Point], first: Factor, second: Factor, study: Study) -> Figure:
    """Slip over two factors, a panel per control, and the change between them."""
    controls = study.run_controls
    maps = [_grid(points, first, second, control) for control in controls]
    paired = len(controls) == 2
    figure = Figure(figsize=(3.6 * (len(controls) + paired) + 0.8, 0.42 * min(len(second.values), 12) + 2.2))
    panels = np.atleast_1d(figure.subplots(1, len(controls) + paired, sharey=True))
    norm = logarithmic(np.concatenate(maps, axis=None))
    for axes, control, values in zip(panels, controls, maps, strict=False):
        _image(figure, axes, values, control, "slip [m/m]", norm, COLOURMAP, first, second)
    if paired:
        with np.errstate(divide="ignore", invalid="ignore"):
            change = 100.0 * (maps[1] / maps[0] - 1.0)
        _image(figure, panels[-1], change, f"{controls[0]} → {controls[1]}", "change [%]", Normalize(-100.0, 100.0), CHANGES, first, second)
    panels[0].set_ylabel(label_of(second))
    return figure


def _grid(points: Sequence[Point], first: Factor, second: Factor, control: str) -> Array:
    """(second, first) mean slip over the points of each cell."""
    total, count = np.zeros((len(second.values), len(first.values))), np.zeros((len(second.values), len(first.values)))
    for point in points:
        value = mean_of(point, control, SLIP)
        if math.isfinite(value):
            place = second.values.index(point.values[second.name]), first.values.index(point.values[first.name])
            total[place] += value
            count[place] += 1
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(total / count)


def _image(
    figure: Figure,
    axes: Axes,
    values: Array,
    title: str,
    label: str,
    norm: Normalize,
    colours: str,
    first: Factor,
    second: Factor,
) -> None:
    axes.set_title(title)
    axes.grid(visible=False)
    image = axes.imshow(values, origin="lower", aspect="auto", cmap=colours, norm=norm)
    for row, column in np.argwhere(~np.isfinite(values)):
        axes.plot(column, row, marker="x", color="0.5")
    if values.size <= 60:
        _numbers(axes, values, image)
    axes.set_xticks(range(len(first.values)), _ticks(first), rotation=45 if len(first.values) > 6 else 0)
    axes.set_yticks(range(len(second.values)), _ticks(second))
    axes.set_xlabel(label_of(first))
    figure.colorbar(image, ax=axes, label=label, shrink=0.9)


def _numbers(axes: Axes, values: Array, image: Any) -> None:
    for (row, column), value in np.ndenumerate(values):
        if math.isfinite(value):
            red, green, blue, _ = image.cmap(image.norm(value))
            light = 0.299 * red + 0.587 * green + 0.114 * blue > 0.55
            axes.text(column, row, f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}", ha="center", va="center", fontsize=7.5,
                      color="black" if light else "white")  # fmt: skip


def response(points: Sequence[Point], factor: Factor, study: Study) -> Figure:
    """Slip and cost over one factor, with intervals."""
    figure = Figure(figsize=(9.0, 3.4))
    names = factor.kind == VALUES and not all(isinstance(value, int | float) for value in factor.values)
    for axes, metric in zip(figure.subplots(1, 2), (SLIP, COST), strict=True):
        for control in study.run_controls:
            x = [factor.values.index(item.values[factor.name]) if names else item.values[factor.name] for item in points]
            order = np.argsort(x)
            mean = np.array([mean_of(item, control, metric) for item in points])[order]
            half = np.array([item.means[control][metric].half_width if control in item.means else math.nan for item in points])[order]
            place = np.array(x, dtype=np.float64)[order]
            axes.plot(
                place, mean, marker=MARKS[control], color=COLOURS[control], markersize=4, label=control, linestyle="" if names else "-"
            )
            axes.fill_between(place, mean - half, mean + half, color=COLOURS[control], alpha=0.2, linewidth=0)
        if names:
            axes.set_xticks(range(len(factor.values)), _ticks(factor))
        axes.set(xlabel=label_of(factor), ylabel=NAMES[metric], ylim=(0.0, None))
    figure.axes[0].legend()
    return figure


def pareto(points: Sequence[Point], study: Study) -> Figure:
    """Slip against cost of transport with the front of each control."""
    figure = Figure(figsize=(6.4, 4.2))
    axes = figure.subplots()
    for control in study.run_controls:
        pairs = np.array([(mean_of(point, control, COST), mean_of(point, control, SLIP)) for point in points if not point.held_out])
        pairs = pairs.reshape(-1, 2)[np.isfinite(pairs.reshape(-1, 2)).all(axis=1)]
        shown = pairs[:: max(math.ceil(len(pairs) / MOST_LINES), 1)]
        axes.plot(*shown.T, linestyle="", marker=MARKS[control], markersize=4, alpha=0.55, color=COLOURS[control], label=control)
        edge = front(pairs)
        axes.plot(*edge.T, drawstyle="steps-post", color=COLOURS[control], linewidth=1.4)
    axes.set(xlabel=NAMES[COST], ylabel=NAMES[SLIP], yscale="log")
    axes.margins(0.05)
    axes.legend(title="lines: the front")
    return figure


def front(pairs: Array) -> Array:
    """(k, 2) the points, by their first figure, that no other is below or equal to in both."""
    kept, best = [], math.inf
    for first, second in pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].tolist():
        if second < best:
            kept.append((first, second))
            best = second
    return np.array(kept, dtype=np.float64).reshape(-1, 2)


def history(study: Study, trials: Sequence[Trial], before: float) -> Figure:
    """The first metric of each trial, the best so far, and what it began from."""
    assert study.optimise is not None
    name = study.optimise.metrics[0]
    unit, less, _ = METRICS[name]
    figure = Figure(figsize=(8.0, 3.4))
    axes = figure.subplots()
    for feasible, mark, label in ((True, "o", "trial"), (False, "x", "breaks a constraint")):
        some = [(trial.number, trial.means[name]) for trial in trials if trial.feasible is feasible]
        if some:
            axes.plot(
                *zip(*some, strict=True), linestyle="", marker=mark, markersize=4.5, color="#0072B2" if feasible else "0.55", label=label
            )
    able = [trial for trial in trials if trial.feasible and math.isfinite(trial.means[name])]
    if able:
        best = (np.minimum if less else np.maximum).accumulate([trial.means[name] for trial in able])
        axes.step([trial.number for trial in able], best, where="post", color="#009E73", label="best so far")
    if math.isfinite(before):
        axes.axhline(before, color="#D55E00", linestyle="--", linewidth=1.2, label="before")
    axes.set(xlabel="trial", ylabel=f"{name} [{unit}]")
    axes.legend(ncols=2)
    return figure
