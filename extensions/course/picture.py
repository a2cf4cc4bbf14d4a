"""Draws the picture of a course: cases by figures, each as its ratio to the control's reference.

Green is better than the reference and orange is worse; pale is the same, as far as the runs tell.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from hexapod_cosim.controller.figure_style import DPI, SETTINGS, UNDATED
from hexapod_cosim.cosim.common.files import atomic_path
from hexapod_cosim.cosim.results.comparison import SAME
from hexapod_cosim.extensions.course.records import SHOWN
from hexapod_cosim.extensions.course.table import CaseFigures, Table
from hexapod_cosim.models import HexapodError

FOLDER, STEM = "plots", "course"
MOST = 2.0  # logarithm to base 2 of the ratio that has the full colour
PALE = 0.35  # of the colour of a change that the runs do not show surely
COLUMNS = ("success", *(quantity.name for quantity in SHOWN))
HEADINGS = ("walked", *(quantity.short for quantity in SHOWN))
LABELS, CELL, ROW = 1.45, 0.47, 0.155  # in    width of the labels, of a cell, height of a row
HEAD, FOOT = 0.75, 0.6  # in
GAP, ROUND = 0.06, 0.12  # of a cell: between cells, of their corners


INK, MUTED = "#15191f", "#5c6570"
# from better to worse
COLOURS = LinearSegmentedColormap.from_list("change", ["#00805e", "#eef0f3", "#c25700"])


@dataclass(frozen=True)
class Cell:
    """A cell: its text, and its colour from -1, better, to 1, worse; NaN where it has none."""

    text: str
    shade: float


def cell_of(case: CaseFigures, column: str) -> Cell:
    """Returns a cell of the picture."""
    if column == "success":
        before = sum(run.success for run in case.reference)
        rate = case.success
        return Cell(f"{rate.successes}/{rate.runs}", (before - rate.successes) / rate.runs)
    if not case.counts(column):
        return Cell("", math.nan)
    change = case.change(column)
    shade = 1.0 if change.after > 0.0 else -1.0
    if change.after > 0.0:
        shade = float(np.clip(math.log2(change.after / change.before) / MOST, -1.0, 1.0))
    pale = PALE if change.verdict == SAME else 1.0
    percent = round(100.0 * change.relative)
    return Cell(f"{percent:+d}" if percent else "0", pale * shade)


def rows_of(table: Table) -> list[str]:
    """Returns the rows from above: "class:NAME" above the names of its cases."""
    rows: list[str] = []
    for case in table.cases_of("all", table.reference):
        heading = f"class:{case.case.kind}"
        rows += [heading] if heading not in rows else []
        rows.append(case.case.name)
    return rows


def draw_course(table: Table) -> Figure:
    """Draws a panel for each column, but one column of a control that is compared with two.

    That with another walk is left out. The reference has a panel where it is alone.
    """
    rows = rows_of(table)
    panels = {table.columns[one][0]: one for one in table.columns if one != table.reference}
    controls = list(panels.values()) or [table.reference]
    width = LABELS + len(controls) * (len(COLUMNS) + 0.6) * CELL
    height = HEAD + ROW * len(rows) + FOOT
    figure = Figure(figsize=(width, height))
    for number, control in enumerate(controls):
        left = LABELS + number * (len(COLUMNS) + 0.6) * CELL
        axes = figure.add_axes(
            (left / width, FOOT / height, len(COLUMNS) * CELL / width, ROW * len(rows) / height)
        )
        _draw_panel(axes, table, control, rows)
        if not number:
            _draw_labels(axes, rows)
    _draw_key(figure, table, width=width, height=height)
    return figure


def _draw_panel(axes: Axes, table: Table, control: str, rows: Sequence[str]) -> None:
    """Draws the cells of a control."""
    axes.set_axis_off()
    axes.set_xlim(0.0, len(COLUMNS))
    axes.set_ylim(len(rows), 0.0)
    for place, heading in enumerate(HEADINGS):
        _write(axes, place + 0.5, -0.35, heading, MUTED, va="bottom", fontsize=6.5)
    beside = " against ".join(dict.fromkeys(table.columns[control]))
    _write(axes, 0.0, -1.9, beside, INK, ha="left", va="bottom", fontsize=9.0, weight="bold")
    for number, row in enumerate(rows):
        case = table.cases.get((row, control))
        for place, column in enumerate(COLUMNS if case is not None else ()):
            assert case is not None
            _draw_cell(axes, place, number, cell_of(case, column))


def _draw_cell(axes: Axes, x: float, y: float, cell: Cell) -> None:
    if math.isnan(cell.shade):
        _write(axes, x + 0.5, y + 0.5, "–", MUTED)
        return
    colour = COLOURS(0.5 + 0.5 * cell.shade)
    box = FancyBboxPatch(
        (x + GAP, y + GAP),
        1.0 - 2.0 * GAP,
        1.0 - 2.0 * GAP,
        boxstyle=f"round,pad=0,rounding_size={ROUND}",
        facecolor=colour,
        edgecolor="none",
        mutation_aspect=CELL / ROW,
    )
    axes.add_patch(box)
    _write(axes, x + 0.5, y + 0.53, cell.text, _ink_on(colour))


def _ink_on(colour: tuple[float, float, float, float]) -> str:
    """Returns the colour of text that is legible on a colour."""
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in colour[:3]
    )
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    return "#15191f" if luminance > 0.2 else "#ffffff"


def _write(axes: Axes, x: float, y: float, text: str, colour: str, **more: Any) -> None:
    style = {"ha": "center", "va": "center", "fontsize": 6.0, **more}
    axes.text(x, y, text, color=colour, clip_on=False, **style)


def _draw_labels(axes: Axes, rows: Sequence[str]) -> None:
    """Writes the names of classes and cases to the left of the first panel."""
    for number, row in enumerate(rows):
        kind, colon, name = row.partition(":")
        style = {"ha": "right", "fontsize": 6.5}
        if colon:
            style |= {"fontsize": 7.0, "weight": "bold"}
        _write(axes, -0.2, number + 0.53, name or kind, INK if colon else MUTED, **style)


def _draw_key(figure: Figure, table: Table, *, width: float, height: float) -> None:
    """Draws the scale of colours below the panels."""
    axes = figure.add_axes((LABELS / width, 0.34 / height, 4.0 * CELL / width, 0.08 / height))
    axes.imshow(np.linspace(-1.0, 1.0, 128)[None, :], aspect="auto", cmap=COLOURS)
    axes.set_axis_off()
    ends = ((0.0, "÷ 4, better", "left"), (0.5, "1", "center"), (1.0, "× 4, worse", "right"))
    for place, text, side in ends:
        _write(axes, place, -0.9, text, MUTED, transform=axes.transAxes, ha=side)
    note = (
        "Change of the means in %, over seeds on which both succeeded; "
        "pale: not sure; –: fewer than half of them did."
    )
    figure.text(
        (LABELS + 4.4 * CELL) / width, 0.38 / height, note, color=MUTED, fontsize=6.5,
        va="center", wrap=True,
    )  # fmt: skip


def write_picture(table: Table, folder: Path) -> list[Path]:
    """Writes the picture as SVG and PNG; returns the files. Raises HexapodError."""
    place = folder / FOLDER
    try:
        place.mkdir(exist_ok=True)
    except OSError as error:
        raise HexapodError("cannot write", got=error.strerror, where=str(place)) from error
    files = [place / f"{STEM}.svg", place / f"{STEM}.png"]
    with matplotlib.rc_context({**SETTINGS, "figure.constrained_layout.use": False}):
        figure = draw_course(table)
        for file in files:
            kind = file.suffix[1:]
            with atomic_path(file) as path:
                figure.savefig(path, format=kind, dpi=DPI, metadata=UNDATED[kind])
    return files
