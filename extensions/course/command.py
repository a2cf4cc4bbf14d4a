"""Defines the command `hexapod benchmark`: controls on the cases of the course."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.cli.failures import SUCCESS
from hexapod_cosim.cosim.cli.options import (
    ControlNames,
    GainsFile,
    Json,
    Settings,
    Workers,
    command_line,
)
from hexapod_cosim.cosim.cli.runs import given_gains
from hexapod_cosim.cosim.cli.terminal import (
    counting_bar,
    show_files,
    show_json,
    show_table,
    show_text,
)
from hexapod_cosim.cosim.common.files import RUN_FILE, write_json
from hexapod_cosim.cosim.control.controllers import check_control
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.folder import ResultsFolder, results_folder
from hexapod_cosim.cosim.scenario.controls import AT, CHOOSER, Control, parse_controls
from hexapod_cosim.cosim.scenario.records import CHOSEN, CONTROLS
from hexapod_cosim.extensions.course import texts
from hexapod_cosim.extensions.course.records import JUDGE, SPLITS, Course, load_course
from hexapod_cosim.extensions.course.report import write_course_report
from hexapod_cosim.extensions.course.runs import Run, run_count, run_course
from hexapod_cosim.extensions.course.store import FILES, read_table, write_result
from hexapod_cosim.extensions.course.table import Table

EPILOG = "A robot that falls or gets stuck is a result: it counts as a failure and is in no mean."

BENCHMARK = "benchmark"  # kind of a folder with its result
MAX_SEEDS = 1000
OTHERS = tuple(name for name in CONTROLS if name != CHOOSER)
DEFAULT = (*OTHERS, *(f"{name}{AT}{CHOSEN}" for name in OTHERS), CHOOSER)
Split = Annotated[
    str, typer.Option("--split", metavar="|".join(SPLITS), help="Cases to judge or to tune on.")
]
Cases = Annotated[
    list[str] | None,
    typer.Option("--case", metavar="NAME", help="A case or a class of the course, repeated."),
]
Seeds = Annotated[
    int | None,
    typer.Option(
        "--seeds",
        min=1,
        max=MAX_SEEDS,
        metavar="N",
        help="Runs of each case and control; default 10.",
    ),
]
Folder = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="DIR", help="Default out/benchmark.")
]


def benchmark(
    controls: ControlNames = None,
    split: Split = JUDGE,
    cases: Cases = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer seeds.")] = False,
    seeds: Seeds = None,
    workers: Workers = None,
    settings: Settings = None,
    output: Folder = None,
    gains: GainsFile = None,
    json: Json = False,
) -> int:
    """Judge controls on the course: ground, payload, sensors, pushes, commands, robots.

    Without --control these are all built-in ones, and kinematic and paper control in the gait and
    stance that compliant control chooses (kinematic@chosen). The first control is the reference; a
    control in that walk is compared with the first one in it, and compliant control with both.
    """
    laws = parse_controls(controls or DEFAULT, where="--control")
    course = load_course(
        split, names=cases or (), seeds=seeds, quick=quick, settings=settings or ()
    )
    check_control(course.cases[0].scenario, laws)
    command = command_line(
        BENCHMARK, split=split, quick=quick, control=controls, case=cases, set=settings,
        seeds=seeds, gains=gains,
    )  # fmt: skip
    with results_folder(output or Path("out") / BENCHMARK, own=FILES) as folder:
        table, content, files = _run_into(
            folder, course, laws, given_gains(gains), workers, command
        )
    if json:
        show_json(content)
    else:
        _show(table)
        show_files(files)
        show_text(f"report: {files[-1]}")
    return SUCCESS


def _run_into(
    folder: ResultsFolder,
    course: Course,
    laws: Sequence[Control],
    gains: Gains | None,
    workers: int | None,
    command: str,
) -> tuple[Table, dict[str, Any], list[Path]]:
    """Runs the course and writes its result and report."""
    folder.begin()
    runs = tuple(_collect(course, laws, gains=gains, workers=workers))
    table = Table(course, tuple(law.label for law in laws), runs)
    content, files = write_result(table, folder.path, command=command)
    files += write_course_report(table, content, folder.path)
    title = f"Course {course.version}, {course.split}: {', '.join(table.controls)}"
    facts = {"kind": BENCHMARK, "status": COMPLETED, "title": title, "command": command}
    write_json(folder.path / RUN_FILE, facts)
    return table, content, [folder.path / RUN_FILE, *files]


def report_on(folder: Path) -> list[Path]:
    """Writes the report of a benchmark's folder again; returns its file. Raises HexapodError."""
    return write_course_report(*read_table(folder), folder)


def _collect(
    course: Course, laws: Sequence[Control], *, gains: Gains | None, workers: int | None
) -> Iterator[Run]:
    """Runs the course, shows the progress, and yields each run."""
    failed = 0
    with (
        counting_bar("benchmark", run_count(course, laws), plain=True) as count,
        closing(run_course(course, laws, gains=gains, workers=workers)) as runs,
    ):
        count(0)
        for done, run in enumerate(runs, start=1):
            failed += not run.success
            count(done, failed)
            yield run


def _show(table: Table) -> None:
    """Prints the tables of a course."""
    course = table.course
    show_text(
        f"Course {course.version} ({course.hash[:12]}), split {course.split}, "
        f"{len(course.cases)} cases, {len(course.seeds)} seeds; reference {table.reference}"
    )
    for title, (columns, rows) in reversed(texts.tables(table)):
        show_text(f"\n{title}")
        show_table(columns, rows)
