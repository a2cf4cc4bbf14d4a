"""Writes report.html, the report of a course in one file, and draws its picture: cases by figures,
each as its ratio to the control's reference.

Green is better than the reference and orange is worse; pale is the same, as far as the runs tell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from hexapod_cosim.controller.figure_style import SETTINGS
from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.report.figures import Figures, figure_files, write_figures
from hexapod_cosim.cosim.report.page import embedded, render
from hexapod_cosim.cosim.results.comparison import SAME
from hexapod_cosim.extensions.course import texts
from hexapod_cosim.extensions.course.records import SHOWN
from hexapod_cosim.extensions.course.table import ALL, CaseFigures, Table

FOLDER, STEM = "plots", "course"
MOST = 2.0  # logarithm to base 2 of the ratio that has the full colour
DARK = 0.8  # size of a shade on which white text is legible
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
    _write(axes, x + 0.5, y + 0.53, cell.text, "#ffffff" if abs(cell.shade) > DARK else INK)


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
    """Writes the picture as PNG and SVG; returns the files."""
    with matplotlib.rc_context({**SETTINGS, "figure.constrained_layout.use": False}):
        files = figure_files(draw_course(table))
        images = {f"{STEM}.{kind}": content for kind, content in files}
    return write_figures(Figures(images, {}), folder / FOLDER)


def write_course_report(table: Table, content: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draws the picture and writes the page. Returns the files, the page last.

    content: of benchmark.json.
    """
    files = write_picture(table, folder) if table.cases else []
    course = table.course
    page = render(
        "course.html.jinja",
        package=__package__,
        controls=table.controls,
        title=f"Course {course.version}, split {course.split}: {', '.join(table.controls)}",
        headline=headline(table),
        lead=lead(table),
        warnings=[] if content["complete"] else ["The course was stopped before its end."],
        picture=embedded(folder / FOLDER / f"{STEM}.svg") if files else None,
        parts=texts.part_rows(table),
        classes=texts.class_rows(table),
        cases=texts.case_rows(table),
        sweeps=texts.sweep_rows(table),
        failures=texts.failure_rows(table),
        command=content["command"],
        facts=_facts(content),
    )  # fmt: skip
    write_text(folder / "report.html", page)
    return [*files, folder / "report.html"]


def headline(table: Table) -> str:
    """Returns how many runs of each control were successes."""
    parts = [
        f"{control} {_share(table.classes[ALL, control].success.interval.value)}"
        for control in table.controls
        if (ALL, control) in table.classes
    ]
    return f"Successful runs: {', '.join(parts)}" if parts else "No run is complete"


def _share(value: float) -> str:
    return texts.NONE if math.isnan(value) else f"{100.0 * value:.0f} %"


def lead(table: Table) -> str:
    """Returns the numbers of cases and seeds, the reference and what a success is, as text."""
    course = table.course
    return (
        f"{len(course.cases)} cases, {len(course.seeds)} seeds from {course.seeds[0]}. "
        f"Changes are from {table.reference} unless the tables name another control. "
        "A success walks upright to the end and arrives."
    )


def _facts(content: Mapping[str, Any]) -> dict[str, str]:
    """Returns what the result depends on, as texts."""
    course, seeds = content["course"], content["seeds"]
    return {
        "course": f"version {course['version']}, split {course['split']}",
        "SHA-256 of the cases": course["hash"],
        "seeds": f"{seeds[0]} to {seeds[-1]}",
        "versions": ", ".join(f"{name} {text}" for name, text in content["versions"].items()),
        "machine": ", ".join(content["machine"].values()),
        **content["methods"],
    }
