"""Compares controls over several scenarios, such as walks on different ground."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hexapod_cosim.controller.figure_style import SETTINGS, WIDTH
from hexapod_cosim.cosim.common.control_style import control_styles
from hexapod_cosim.cosim.common.files import atomic_text
from hexapod_cosim.cosim.report.figures import Figures, figure_files, write_figures
from hexapod_cosim.cosim.results.side_by_side import Comparisons
from hexapod_cosim.cosim.results.summary import Summary, finite_mean

TABLE, FIGURE = "terrains.csv", "terrains"
LARGEST, SMALLER = 7.0, 0.75  # size of the first control's mark, and share of each next one's
ROOM = 1.06  # of an axis over its largest value


class Quantity(NamedTuple):
    """A column of the table, a mean over the runs that walked to the end."""

    unit: str
    digits: int
    title: str


QUANTITIES = {
    "slip": Quantity("mm/m", 0, "slip of all feet"),
    "peak": Quantity("BW", 2, "largest foot force"),
    "tilt": Quantity("deg", 2, "tilt, RMS"),
    "path": Quantity("mm/m", 0, "path error"),
}
WALKED = Quantity("%", 0, "walked to the end")
Row = dict[str, Any]  # scenario, control, runs, walked, a value by QUANTITIES (NaN: none), reason


def terrain_rows(name: str, comparison: Comparisons) -> list[Row]:
    """Returns the rows of a scenario, one for each control, as for JSON."""
    return [_row(name, label, runs) for label, runs in comparison.runs.items()]


def _row(name: str, control: str, runs: tuple[Summary, ...]) -> Row:
    walked = [run.metrics for run in runs if run.success]
    tilts = [math.hypot(run["roll_rms"], run["pitch_rms"]) for run in walked]
    return {
        "scenario": name,
        "control": control,
        "runs": len(runs),
        "walked": len(walked),
        "slip": 1e3 * finite_mean([run["slip_per_metre"] for run in walked]),
        "peak": finite_mean([run["peak_force"] for run in walked]),
        "tilt": math.degrees(finite_mean(tilts)),
        "path": 1e3 * finite_mean([run["path_error"] for run in walked]),
        "reason": next((run.failure for run in runs if not run.success), ""),
    }


def table_columns(rows: list[Row]) -> dict[str, list[str]]:
    """Returns the table as texts, column by column."""
    columns = {key: [row[key] for row in rows] for key in ("scenario", "control")}
    columns["walked"] = [f"{row['walked']} of {row['runs']}" for row in rows]
    for name, (unit, digits, _) in QUANTITIES.items():
        columns[f"{name}, {unit}"] = [_text(row[name], f".{digits}f") or "-" for row in rows]
    return columns


def _text(value: Any, digits: str) -> str:
    """Returns a number as text, "" for NaN; other values as they are."""
    if not isinstance(value, float):
        return str(value)
    return f"{value:{digits}}" if math.isfinite(value) else ""


def write_terrains(rows: list[Row], folder: Path) -> list[Path]:
    """Writes the table as CSV and the figure as PNG and SVG; returns the files."""
    with atomic_text(folder / TABLE) as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows({key: _text(value, ".6g") for key, value in row.items()} for row in rows)
    with matplotlib.rc_context(SETTINGS):
        images = {f"{FIGURE}.{kind}": image for kind, image in figure_files(draw_terrains(rows))}
    return [folder / TABLE, *write_figures(Figures(images, {}), folder)]


def draw_terrains(rows: list[Row]) -> Figure:
    """Draws a panel per quantity, a line per scenario, a mark per control."""
    scenarios = list(dict.fromkeys(row["scenario"] for row in rows))
    figure = Figure(figsize=(WIDTH, 0.9 + 0.3 * len(scenarios)))
    shares = [100.0 * row["walked"] / row["runs"] for row in rows]
    panels = [(WALKED, shares)]
    panels += [(quantity, [row[name] for row in rows]) for name, quantity in QUANTITIES.items()]
    axes = figure.subplots(1, len(panels), sharey=True)
    for axis, (quantity, values) in zip(axes, panels, strict=True):
        _draw_quantity(axis, quantity, [row["control"] for row in rows], values)
    axes[0].set_yticks(range(len(scenarios)), scenarios)
    axes[0].invert_yaxis()
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


def _draw_quantity(
    axis: Axes, quantity: Quantity, controls: list[str], values: list[float]
) -> None:
    """Draws one panel: all controls of a scenario on one line, joined by a bar."""
    styles = control_styles(controls)
    table = np.array(values).reshape(-1, len(styles)).T  # (controls, scenarios)
    places = list(range(table.shape[1]))
    axis.hlines(places, table.min(0), table.max(0), color="0.8", linewidth=2.2, zorder=1)
    for number, (style, row) in enumerate(zip(styles.values(), table, strict=True)):
        axis.plot(
            row,
            places,
            color=style.light,
            label=list(styles)[number],
            marker=style.marker,
            markersize=LARGEST * SMALLER**number,  # marks of equal values stay visible
            linestyle="none",
            clip_on=False,
        )
    axis.set_title(quantity.title, fontsize="small")
    axis.set_xlabel(quantity.unit)
    most = 100.0 if quantity is WALKED else float(np.nanmax(table, initial=0.0))
    axis.set_xlim(0.0, ROOM * (most or 1.0))
    axis.grid(visible=True, axis="x")
