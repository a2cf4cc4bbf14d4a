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
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hexapod_cosim.cosim.files import atomic_path
from hexapod_cosim.cosim.metrics import METRICS
from hexapod_cosim.cosim.plots import SETTINGS
from hexapod_cosim.cosim.study.optimise import Trial
from hexapod_cosim.cosim.study.records import VALUES, Factor, Study
from hexapod_cosim.cosim.study.table import Point
from hexapod_cosim.models import HexapodError

Array = NDArray[np.float64]

COLOURS = {"kinematic": "#D55E00", "compliant": "#0072B2"}
MARKS = {"kinematic": "s", "compliant": "o"}
SLIP, COST = "slip_per_metre", "cost_of_transport"
NAMES = {SLIP: "slip [m/m]", COST: "cost of transport [1]"}
COLOURMAP, CHANGES = "viridis", "RdBu_r"
MOST_LINES, MOST_CELLS = 1500, 40  # beyond them a figure only gets slower and darker


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
            for suffix, options in ((".svg", {"metadata": {"Date": None}}), (".png", {"dpi": 130})):
                with atomic_path(folder / f"{name}{suffix}") as path:
                    figure.savefig(path, **options)
                files.append(folder / f"{name}{suffix}")
    return files


def mean_of(point: Point, control: str, metric: str) -> float:
    """NaN where there is none."""
    return point.means[control][metric].value if control in point.means else math.nan


def _label(factor: Factor) -> str:
    unit = "designed" if factor.relative else factor.unit
    return f"{factor.name} [{unit}]" if unit else factor.name


def _ticks(factor: Factor) -> list[str]:
    return [f"{value:.4g}" if isinstance(value, float) else str(value) for value in factor.values]


def heat_map(points: Sequence[Point], first: Factor, second: Factor, study: Study) -> Figure:
    """Slip over two factors, a panel per control, and the change between them."""
    controls = study.run_controls
    maps = [_grid(points, first, second, control) for control in controls]
    paired = len(controls) == 2
    figure = Figure(figsize=(3.6 * (len(controls) + paired) + 0.8, 0.42 * min(len(second.values), 12) + 2.2))
    panels = np.atleast_1d(figure.subplots(1, len(controls) + paired, sharey=True))
    top = max((float(np.nanmax(item)) for item in maps if np.isfinite(item).any()), default=1.0)
    for axes, control, values in zip(panels, controls, maps, strict=False):
        _image(figure, axes, values, control, "slip [m/m]", (0.0, top), COLOURMAP, first, second)
    if paired:
        with np.errstate(divide="ignore", invalid="ignore"):
            change = 100.0 * (maps[1] / maps[0] - 1.0)
        _image(figure, panels[-1], change, f"{controls[0]} → {controls[1]}", "change [%]", (-100.0, 100.0), CHANGES, first, second)
    panels[0].set_ylabel(_label(second))
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
    limits: tuple[float, float],
    colours: str,
    first: Factor,
    second: Factor,
) -> None:
    axes.set_title(title)
    axes.grid(visible=False)
    image = axes.imshow(values, origin="lower", aspect="auto", cmap=colours, vmin=limits[0], vmax=limits[1])
    for row, column in np.argwhere(~np.isfinite(values)):
        axes.plot(column, row, marker="x", color="0.5")
    if values.size <= 60:
        _numbers(axes, values, image)
    axes.set_xticks(range(len(first.values)), _ticks(first), rotation=45 if len(first.values) > 6 else 0)
    axes.set_yticks(range(len(second.values)), _ticks(second))
    axes.set_xlabel(_label(first))
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
        axes.set(xlabel=_label(factor), ylabel=NAMES[metric], ylim=(0.0, None))
    figure.axes[0].legend()
    return figure


def parallel(points: Sequence[Point], study: Study) -> Figure:
    """Parallel coordinates: an axis per factor, then slip and cost; a line per point and control."""
    factors, controls = study.factors, study.run_controls
    chosen = _some([point for point in points if not point.held_out and None not in point.values.values()])
    figure = Figure(figsize=(max(1.5 * (len(factors) + 3), 7.0), 3.2 * len(controls) + 0.4))
    placed = [tuple(_place(factor, point) for factor in factors) for point in chosen]
    rows = [[(*places, mean_of(point, control, SLIP), mean_of(point, control, COST)) for point, places in zip(chosen, placed, strict=True)]
            for control in controls]  # fmt: skip
    table = np.array(rows, dtype=np.float64).reshape(len(controls), len(chosen), len(factors) + 2)
    low, high = np.nanmin(table, axis=(0, 1)), np.nanmax(table, axis=(0, 1))
    scaled = (table - low) / np.where(high > low, high - low, 1.0)
    panels = np.atleast_1d(figure.subplots(len(controls), 1))
    for axes, control, lines in zip(panels, controls, scaled, strict=True):
        _coordinates(figure, axes, lines, control, factors, (low, high))
    return figure


def _coordinates(figure: Figure, axes: Axes, lines: Array, control: str, factors: Sequence[Factor], ends: tuple[Array, Array]) -> None:
    count, (low, high) = lines.shape[1], ends
    whole = lines[np.isfinite(lines).all(axis=1)]
    whole = whole[np.argsort(-whole[:, -2])]  # little slip on top
    paths = [np.column_stack([np.arange(count), line]) for line in whole]
    collection = LineCollection(paths, array=whole[:, -2] * (high[-2] - low[-2]) + low[-2], cmap=COLOURMAP, linewidth=0.9, alpha=0.7)
    collection.set_clim(low[-2], high[-2])
    axes.add_collection(collection)
    axes.set(xlim=(-0.15, count - 0.85), ylim=(-0.08, 1.08), title=control, yticks=[])
    axes.set_xticks(range(count), [*(_label(factor).replace(" [", "\n[") for factor in factors), "slip\n[m/m]", "cost of\ntransport"])
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)
    for place in range(count):
        axes.axvline(place, color="0.6", linewidth=0.8, zorder=0)
        _ends(axes, place, factors[place] if place < len(factors) else None, float(low[place]), float(high[place]))
    figure.colorbar(collection, ax=axes, label="slip [m/m]", shrink=0.9)


def _ends(axes: Axes, place: int, factor: Factor | None, low: float, high: float) -> None:
    """What the ends of an axis mean: numbers, or the first and last of names."""
    texts = (f"{low:.3g}", f"{high:.3g}")
    if factor is not None and _is_named(factor):
        texts = (str(factor.values[int(low)]), str(factor.values[int(high)]))
    for y, text, side in ((-0.02, texts[0], "top"), (1.02, texts[1], "bottom")):
        axes.text(place, y, text, ha="center", va=side, fontsize=7, color="0.35")


def _is_named(factor: Factor) -> bool:
    return factor.kind == VALUES and not all(isinstance(value, int | float) and not isinstance(value, bool) for value in factor.values)


def _place(factor: Factor, point: Point) -> float:
    value = point.values[factor.name]
    return float(factor.values.index(value)) if _is_named(factor) else float(value)


def _some(points: Sequence[Point]) -> list[Point]:
    """Not more than can be seen, evenly chosen."""
    step = max(math.ceil(len(points) / MOST_LINES), 1)
    return list(points[::step])


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
    axes.set(xlabel=NAMES[COST], ylabel=NAMES[SLIP], ylim=(0.0, None))
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
