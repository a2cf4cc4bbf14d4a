"""Writes report.html, the report of a course in one file: its tables, and cases by figures.

A cell is the change of a figure from the control's reference: green is better and orange is worse;
pale is the same, as far as the runs tell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.report.page import render
from hexapod_cosim.cosim.results.comparison import SAME
from hexapod_cosim.extensions.course import texts
from hexapod_cosim.extensions.course.records import SHOWN
from hexapod_cosim.extensions.course.table import ALL, CaseFigures, Table

MOST = 2.0  # logarithm to base 2 of the ratio that has the full colour
PALE = 0.35  # of the colour of a change that the runs do not show surely
COLUMNS = ("success", *(quantity.name for quantity in SHOWN))
HEADINGS = ("walked", *(quantity.short for quantity in SHOWN))


@dataclass(frozen=True)
class Cell:
    """A cell: its text, and its colour from -1, better, to 1, worse."""

    text: str
    shade: float

    @property
    def colour(self) -> str:
        """The background as CSS, which suits light and dark pages."""
        name = "better" if self.shade < 0.0 else "worse"
        return f"color-mix(in srgb, var(--{name}) {70.0 * abs(self.shade):.0f}%, var(--card))"


def cell_of(case: CaseFigures, column: str) -> Cell:
    """Returns a cell of the table of cases by figures."""
    if column == "success":
        before = sum(run.success for run in case.reference)
        rate = case.success
        return Cell(f"{rate.successes}/{rate.runs}", (before - rate.successes) / rate.runs)
    if not case.counts(column):
        return Cell("", 0.0)
    change = case.change(column)
    shade = 1.0 if change.after > 0.0 else -1.0
    if change.after > 0.0:
        shade = min(max(math.log2(change.after / change.before) / MOST, -1.0), 1.0)
    pale = PALE if change.verdict == SAME else 1.0
    percent = round(100.0 * change.relative)
    return Cell(f"{percent:+d}" if percent else "0", pale * shade)


def panels(table: Table) -> dict[str, list[tuple[str, str, list[Cell]]]]:
    """Returns class, name and cells of each case, by the columns that are compared.

    The reference has a panel where it is alone.
    """
    compared = {
        " against ".join(dict.fromkeys(pair)): column
        for column, pair in table.columns.items()
        if column != table.reference or len(table.columns) == 1
    }
    return {
        title: [
            (case.case.kind, case.case.name, [cell_of(case, name) for name in COLUMNS])
            for case in table.cases_of(ALL, column)
        ]
        for title, column in compared.items()
    }


def write_course_report(table: Table, content: Mapping[str, Any], folder: Path) -> list[Path]:
    """Writes the page and returns its file. `content` is that of benchmark.json."""
    course = table.course
    page = render(
        "course.html.jinja",
        package=__package__,
        controls=table.controls,
        title=f"Course {course.version}, split {course.split}: {', '.join(table.controls)}",
        headline=headline(table),
        lead=lead(table),
        panels=panels(table),
        headings=HEADINGS,
        classes=texts.class_rows(table),
        cases=texts.case_rows(table),
        sweeps=texts.sweep_rows(table),
        failures=texts.failure_rows(table),
        command=content["command"],
        facts=_facts(content),
    )
    write_text(folder / "report.html", page)
    return [folder / "report.html"]


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
