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
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from hexapod_cosim.controller.figure_style import DPI, SETTINGS, UNDATED
from hexapod_cosim.cosim.common.control_style import ControlStyle, control_styles
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.extensions.study.groups import Point
from hexapod_cosim.extensions.study.optimum import Trial
from hexapod_cosim.extensions.study.records import GRID, VALUES, Factor, Study
from hexapod_cosim.extensions.study.report.heat import (
    SLIP,
    heat_map,
    mean_of,
    ticks_of,
)
from hexapod_cosim.extensions.study.report.tables import label_of
from hexapod_cosim.extensions.study.summary import Results
from hexapod_cosim.models import HexapodError

MAX_CELLS = 40  # more make a figure slower and no clearer
MAX_PANELS, COLUMNS = 9, 3  # panels, and panels side by side


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
    study, found = results.study, dict[str, Drawing]()
    points = [point for point in results.points if not point.held_out]
    if study.optimise is not None and results.trials:
        caption = (
            f"Mean {study.optimise.metrics[0]} of each trial over its training runs, and the best "
            "so far; dashed: before the optimisation."
        )
        draw = partial(history, study, results.trials, before)
        found["history"] = Drawing("Optimisation", caption, draw)
    elif any(
        math.isfinite(mean_of(point, control, SLIP))
        for point in points
        for control in study.controls
    ):
        found |= _of_factors(study, points)
    return found


def _of_factors(study: Study, points: Sequence[Point]) -> dict[str, Drawing]:
    """Returns the figure over two factors of a grid, or over each factor."""
    axes = [
        factor
        for factor in study.factors
        if factor.kind == VALUES and 1 < len(factor.values) <= MAX_CELLS
    ]
    if study.design == GRID and len(axes) >= 2:
        averaged = ", averaged over the others" if len(study.factors) > 2 else ""
        caption = f"Mean slip per metre{averaged}. Grey: no run (no pair) with a figure."
        draw = partial(heat_map, points, axes[0], axes[1], study)
        return {"heat_map": Drawing(f"{axes[0].name} and {axes[1].name}", caption, draw)}
    varied = [factor for factor in study.factors if len(set(factor.values)) != 1][:MAX_PANELS]
    if not varied:
        return {}
    bars = "; bars: Student's 95 % intervals over seeds" if len(study.seeds) > 1 else ""
    caption = f"Mean slip per metre of each point over each factor by itself{bars}."
    draw = partial(over_factors, points, varied, study)
    return {"effects": Drawing("Slip over each factor", caption, draw)}


def save(found: dict[str, Drawing], folder: Path) -> list[Path]:
    """Writes every figure as SVG and PNG; returns the files. Raises HexapodError."""
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
                # the layout takes as long as the drawing, and is the same for both formats
                figure.set_layout_engine("none")
                files.append(folder / f"{name}.{kind}")
    return files


def over_factors(points: Sequence[Point], factors: Sequence[Factor], study: Study) -> Figure:
    """Draws the slip over a factor in each panel, with a mark and an interval for each point."""
    columns = min(len(factors), COLUMNS)
    rows = math.ceil(len(factors) / columns)
    width = 4.2 if len(factors) < COLUMNS else 3.1
    figure = Figure(figsize=(width * columns + 0.6, 2.7 * rows + 0.5))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for one, factor in zip(axes, factors, strict=False):
        for control, style in control_styles(study.controls).items():
            _marks(one, points, factor, control, style)
        if _named(factor):
            names = ticks_of(factor)
            rotation = 20 if max(map(len, names)) > 8 else 0
            one.set_xticks(range(len(names)), names, rotation=rotation)
        one.set(xlabel=label_of(factor), ylabel="slip [m/m]")
        one.margins(x=0.05, y=0.12)
    for one in axes[len(factors) :]:
        one.set_visible(False)
    axes[0].legend(fontsize=7)
    return figure


def _named(factor: Factor) -> bool:
    """Returns whether the values of a factor are names or booleans rather than numbers."""
    return any(isinstance(value, str | bool) for value in factor.values)


def _marks(
    axes: Axes, points: Sequence[Point], factor: Factor, control: str, style: ControlStyle
) -> None:
    """Draws a mark per point."""
    names = list(dict.fromkeys(factor.values)) if _named(factor) else []
    values = [point.values[factor.name] for point in points]
    place = np.array([names.index(value) if names else value for value in values], dtype=float)
    means = [point.figures.means[control][SLIP] for point in points]
    half = np.array([item.half_width for item in means])
    axes.errorbar(
        place,
        [item.value for item in means],
        np.where(np.isfinite(half), half, 0.0),
        linestyle="",
        marker=style.marker,
        markersize=4,
        alpha=0.7,
        capsize=2.5,
        color=style.light,
        label=control,
    )


def history(study: Study, trials: Sequence[Trial], before: float) -> Figure:
    """Draws the first metric of each trial, the best so far, and the value before."""
    assert study.optimise is not None
    name = study.optimise.metrics[0]
    unit, less, _ = METRICS[name]
    figure = Figure(figsize=(8.0, 3.4))
    axes = figure.subplots()
    known = [trial for trial in trials if math.isfinite(trial.means[name])]
    lost = [trial.number for trial in trials if not math.isfinite(trial.means[name])]
    for feasible, mark, label in ((True, "o", "trial"), (False, "x", "breaks a constraint")):
        shown = [trial for trial in known if trial.feasible is feasible]
        values = [trial.means[name] for trial in shown]
        colour = "#0072B2" if feasible else "0.55"
        axes.plot([trial.number for trial in shown], values, mark, color=colour, label=label)
        if feasible and shown:
            best = (np.minimum if less else np.maximum).accumulate(values)
            numbers = [trial.number for trial in shown]
            axes.step(numbers, best, where="post", color="#009E73", label="best so far")
    if lost:
        place, label = axes.get_xaxis_transform(), "no figure: a run fell"
        axes.plot(lost, [0.03] * len(lost), "|", color="#D55E00", label=label, transform=place)
    if math.isfinite(before):
        axes.axhline(before, color="#D55E00", linestyle="--", linewidth=1.2, label="before")
    last = max(study.optimise.trials - 0.5, 0.5)
    axes.set(xlabel="trial", ylabel=f"{name} [{unit}]", xlim=(-0.5, last))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    figure.legend(loc="outside upper center", ncols=5)
    return figure
