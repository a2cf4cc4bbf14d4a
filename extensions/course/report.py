"""Writes report.html, the report of a course in one file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import write_text
from hexapod_cosim.cosim.report.page import embedded, render
from hexapod_cosim.extensions.course import texts
from hexapod_cosim.extensions.course.picture import write_picture
from hexapod_cosim.extensions.course.table import ALL, Table

REPORT, TEMPLATE = "report.html", "course.html.jinja"


def write_course_report(table: Table, content: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draws the picture and writes the page. Returns the files, the page last.

    content: of benchmark.json.
    """
    files = write_picture(table, folder) if table.cases else []
    page = render(
        TEMPLATE,
        extension="course",
        controls=table.controls,
        title=title_of(table),
        headline=headline(table),
        lead=lead(table),
        warnings=[] if content["complete"] else ["The course was stopped before its end."],
        picture=embedded(files[0]) if files else None,
        parts=texts.part_rows(table),
        classes=texts.class_rows(table),
        cases=texts.case_rows(table),
        sweeps=texts.sweep_rows(table),
        failures=texts.failure_rows(table),
        command=content["command"],
        facts=_facts(content),
    )  # fmt: skip
    write_text(folder / REPORT, page)
    return [*files, folder / REPORT]


def title_of(table: Table) -> str:
    """Returns the title of the page."""
    course = table.course
    return f"Course {course.version}, split {course.split}: {', '.join(table.controls)}"


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
