"""Draws figures of walks under several controls on several kinds of ground."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import SETTINGS, WIDTH
from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.results.side_by_side import SEEDS, read_seeds
from hexapod_cosim.cosim.results.summary import Summary, finite_mean

LARGEST, SMALLER = 7.0, 0.75  # size of the first control's mark, and share of each next one's
ROOM = 1.06  # of an axis over its largest value


@dataclass(frozen=True)
class Quantity:
    """A column of the table."""

    name: str
    unit: str
    title: str


QUANTITIES = (
    Quantity("walked", "%", "walked to the end"),
    Quantity("slip", "mm/m", "slip of all feet"),
    Quantity("peak", "BW", "largest foot force"),
    Quantity("tilt", "deg", "tilt, RMS"),
    Quantity("path", "mm/m", "path error"),
)


@dataclass(frozen=True)
class Row:
    """Figures of one control on one ground: means over its runs that walked to the end."""

    scenario: str
    control: str
    values: Mapping[str, float]  # by the quantity's name; NaN where no run walked


def draw(folder: Path, names: Iterable[str], picture: Path) -> None:
    """Draws the comparisons in folders of these names into a picture."""
    rows = [
        _row(name, label, runs)
        for name in names
        for label, runs in read_seeds(folder / name / SEEDS).items()
    ]
    with matplotlib.rc_context(SETTINGS):
        draw_terrains(rows).savefig(picture)


def _row(name: str, control: str, runs: list[Summary]) -> Row:
    walked = [run.metrics for run in runs if run.success]
    tilts = [math.hypot(run["roll_rms"], run["pitch_rms"]) for run in walked]
    values = {
        "walked": 100.0 * len(walked) / len(runs),
        "slip": 1e3 * finite_mean([run["slip_per_metre"] for run in walked]),
        "peak": finite_mean([run["peak_force"] for run in walked]),
        "tilt": math.degrees(finite_mean(tilts)),
        "path": 1e3 * finite_mean([run["path_error"] for run in walked]),
    }
    return Row(name, control, values)


def draw_terrains(rows: list[Row]) -> Figure:
    """Draws a panel per quantity, a line per scenario, a mark per control."""
    scenarios = list(dict.fromkeys(row.scenario for row in rows))
    figure = Figure(figsize=(WIDTH, 0.9 + 0.3 * len(scenarios)))
    axes = figure.subplots(1, len(QUANTITIES), sharey=True)
    for axis, quantity in zip(axes, QUANTITIES, strict=True):
        _draw_quantity(axis, quantity, rows, scenarios)
    axes[0].set_yticks(range(len(scenarios)), scenarios)
    axes[0].invert_yaxis()
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


def _draw_quantity(axis: Axes, quantity: Quantity, rows: list[Row], scenarios: list[str]) -> None:
    """Draws one panel: all controls of a scenario on one line, joined by a bar."""
    by_control: dict[str, list[float]] = {}
    for row in rows:
        by_control.setdefault(row.control, []).append(row.values[quantity.name])
    styles = control_styles(by_control)
    table = np.array(list(by_control.values()))
    axis.hlines(range(len(scenarios)), *_ends(table), color="0.8", linewidth=2.2, zorder=1)
    for number, (control, values) in enumerate(by_control.items()):
        size = LARGEST * SMALLER**number  # marks of equal values stay visible
        mark: dict[str, Any] = {
            "marker": styles[control].marker,
            "markersize": size,
            "linestyle": "none",
        }
        places = list(range(len(scenarios)))
        axis.plot(values, places, color=styles[control].light, label=control, clip_on=False, **mark)
    axis.set_title(quantity.title, fontsize="small")
    axis.set_xlabel(quantity.unit)
    most = 100.0 if quantity.unit == "%" else float(np.nanmax(table, initial=0.0))
    axis.set_xlim(0.0, ROOM * (most or 1.0))
    axis.grid(visible=True, axis="x")


def _ends(table: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[Any, Any]:
    """Returns the least and the largest of all controls' values, NaN where one is missing."""
    return table.min(axis=0), table.max(axis=0)
