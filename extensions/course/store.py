"""Writes a course's result: JSON to publish, and every run as CSV."""

from __future__ import annotations

import csv
import math
import platform
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import atomic_text, read_json, why_unreadable, write_json
from hexapod_cosim.cosim.common.plant_files import package_version
from hexapod_cosim.extensions.course.records import QUANTITIES, Case, CourseError, load_course
from hexapod_cosim.extensions.course.runs import Run
from hexapod_cosim.extensions.course.statistics import DRAWS
from hexapod_cosim.extensions.course.table import Table

RESULT, RUNS = FILES = ("benchmark.json", "runs.csv")
FORMAT = 1
METHODS = {  # how the intervals are made
    "success": "Wilson, 95 %",
    "means": "over successful runs; Student, 95 %",
    "changes": "over pairs of successful runs; Student, of the ratio's logarithm, 95 %",
    "ratios": f"median over cases; percentile bootstrap over seeds, {DRAWS} draws, 95 %",
}
PACKAGES = ("numpy", "scipy", "control", "fmpy")


def result_table(table: Table, *, command: str) -> dict[str, Any]:
    """Returns the content of benchmark.json; all of it but `machine` repeats bit by bit."""
    course = table.course
    return {
        "format": FORMAT,
        "course": {
            "version": course.version,
            "hash": course.hash,
            "split": course.split,
            "settings": list(course.settings),
        },
        "command": command,
        "controls": list(table.controls),
        "reference": table.reference,
        "seeds": list(course.seeds),
        "versions": {  # that figures depend on
            "hexapod-cosim": package_version(),
            "python": platform.python_version(),
            **{name: version(name) for name in PACKAGES},
        },
        "machine": {
            "platform": f"{sys.platform} {platform.machine()}",
            "processor": platform.processor() or platform.machine(),
        },
        "methods": METHODS,
        "quantities": {
            item.name: {"title": item.title, "unit": item.unit, "metric": item.metric}
            for item in QUANTITIES
        },
        "classes": _by_control(table.classes),
        "cases": {
            name: {**_case_table(case), "controls": controls}
            for name, controls in _by_control(table.cases).items()
            for case in course.cases
            if case.name == name
        },
    }


def _by_control(figures: Mapping[tuple[str, str], Any]) -> dict[str, dict[str, Any]]:
    """Returns the tables of figures by name and control."""
    found: dict[str, dict[str, Any]] = {}
    for (name, control), item in figures.items():
        found.setdefault(name, {})[control] = item.as_table()
    return found


def _case_table(case: Case) -> dict[str, Any]:
    sweep = {"sweep": case.sweep, "height": case.height} if case.sweep else {}
    return {"class": case.kind, "about": case.about, **sweep, "scenario": case.scenario.to_table()}


def write_runs(path: Path, runs: Sequence[Run]) -> None:
    """Writes a line for each run. The file is never partial."""
    names = [item.name for item in QUANTITIES]
    with atomic_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "control", "seed", "failure", *names])
        for run in runs:
            cells = [_cell(run.values[name]) for name in names]
            writer.writerow([run.case, run.control, run.seed, run.failure, *cells])


def _cell(value: float) -> str:
    return "" if math.isnan(value) else repr(value)


def read_table(folder: Path) -> tuple[Table, dict[str, Any]]:
    """Reads the table of a folder and the content of its RESULT. Raises HexapodError."""
    content = read_json(folder / RESULT)
    try:
        course = load_course(
            content["course"]["split"],
            names=content["cases"],
            seeds=len(content["seeds"]),
            settings=content["course"]["settings"],
        )
        if content["course"]["hash"] != course.hash:
            raise CourseError(
                "the result of another course",
                got=f"version {content['course']['version']}, {content['course']['hash'][:12]}",
                expected=f"version {course.version}, {course.hash[:12]}",
                fix="run `hexapod benchmark` again",
                where=str(folder / RESULT),
            )
        runs = tuple(_read_runs(folder / RUNS))
        return Table(course, tuple(content["controls"]), runs), content
    except (KeyError, TypeError, ValueError, OSError) as error:
        raise CourseError(
            "damaged result",
            got=why_unreadable(error, "result of a benchmark"),
            expected=f"{RESULT} and {RUNS} of a benchmark",
            fix="run `hexapod benchmark` again",
            where=str(folder),
        ) from error


def _read_runs(path: Path) -> Iterator[Run]:
    """Yields the runs of a CSV file."""
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            values = {
                item.name: float(row[item.name]) if row[item.name] else math.nan
                for item in QUANTITIES
            }
            yield Run(row["case"], row["control"], int(row["seed"]), row["failure"], values)


def write_result(table: Table, folder: Path, *, command: str) -> tuple[dict[str, Any], list[Path]]:
    """Writes RESULT and RUNS; returns the content of RESULT and the files."""
    content = result_table(table, command=command)
    write_json(folder / RESULT, content)
    write_runs(folder / RUNS, table.runs)
    return content, [folder / RESULT, folder / RUNS]
