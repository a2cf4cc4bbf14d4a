"""Defines the command `hexapod benchmark`: controls on the cases of the course."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.failures import SUCCESS
from hexapod_cosim.cosim.cli.running import GainsFile, given_gains
from hexapod_cosim.cosim.cli.terminal import (
    Json,
    counting_bar,
    show_files,
    show_json,
    show_table,
    show_text,
    warn,
)
from hexapod_cosim.cosim.common.files import RUN_FILE, write_json
from hexapod_cosim.cosim.course import texts
from hexapod_cosim.cosim.course.goals import verdicts
from hexapod_cosim.cosim.course.reading import load_course
from hexapod_cosim.cosim.course.records import JUDGE, SPLITS, Course, CourseError
from hexapod_cosim.cosim.course.runs import Run, run_count, run_course
from hexapod_cosim.cosim.course.store import write_result
from hexapod_cosim.cosim.course.table import Table
from hexapod_cosim.cosim.master.interrupts import deferred_interrupts
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.results import ResultsFolder, results_folder
from hexapod_cosim.cosim.scenario.records import CONTROLS
from hexapod_cosim.models import unknown_name

EPILOG = (
    "A robot that falls or gets stuck is a result: it counts as a failure and is in no mean. "
    "Ctrl-C writes the table of the runs that are done."
)
KIND = "benchmark"
MAX_SEEDS = 1000
Controls = Annotated[
    list[str] | None,
    typer.Option(
        "--control",
        metavar="NAME",
        help="A control to run, repeated for more; the first is the reference. Default: all.",
        autocompletion=completion.control,
    ),
]
Cases = Annotated[
    list[str] | None,
    typer.Option("--case", metavar="NAME", help="A case or a class of the course, repeated."),
]


def benchmark(
    controls: Controls = None,
    split: Annotated[
        str,
        typer.Option("--split", metavar="|".join(SPLITS), help="Cases to judge or to tune on."),
    ] = JUDGE,
    cases: Cases = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer seeds.")] = False,
    seeds: Annotated[
        int | None,
        typer.Option("--seeds", metavar="N", help="Runs of each case and control; default 10."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", metavar="N", help="Processes; default: one for each processor."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Default out/benchmark."),
    ] = None,
    gains: GainsFile = None,
    json: Json = False,
) -> int:
    """Judge controls on the course: ground, payload, sensors, pushes, commands, robots."""
    chosen = _checked_controls(controls or list(CONTROLS))
    _check_number(seeds, MAX_SEEDS, "--seeds")
    _check_number(workers, MAX_SEEDS, "--workers")
    course = load_course(split, names=cases or (), seeds=seeds, quick=quick)
    options = {"control": controls, "case": cases, "seeds": seeds, "gains": gains}
    command = _command_line(options, split=split, quick=quick)
    with results_folder(output or Path("out") / KIND) as folder:
        table, content, files = _run_into(
            folder, course, chosen, given_gains(gains), workers, command
        )
    if json:
        show_json(content)
    else:
        _show(table)
        show_files(files)
    return SUCCESS


def _run_into(
    folder: ResultsFolder,
    course: Course,
    controls: Sequence[str],
    gains: Gains | None,
    workers: int | None,
    command: str,
) -> tuple[Table, dict[str, Any], list[Path]]:
    """Runs the course and writes its result; an interrupt writes that of the completed runs."""
    done: list[Run] = []
    folder.begin()
    try:
        _collect(done, course, controls, gains=gains, workers=workers)
    except KeyboardInterrupt:
        with deferred_interrupts():
            table = Table(course, tuple(controls), tuple(done))
            write_result(table, folder.path, command=command, complete=False)
            _show(table)
            total = run_count(course, controls)
            warn(f"stopped after {len(done)} of {total} runs; their table is in {folder.path}")
        raise
    table = Table(course, tuple(controls), tuple(done))
    content, files = write_result(table, folder.path, command=command, complete=True)
    title = f"Course {course.version}, {course.split}: {', '.join(controls)}"
    facts = {"kind": KIND, "status": COMPLETED, "title": title, "command": command}
    write_json(folder.path / RUN_FILE, facts)
    return table, content, [*files, folder.path / RUN_FILE]


def _collect(
    done: list[Run],
    course: Course,
    controls: Sequence[str],
    *,
    gains: Gains | None,
    workers: int | None,
) -> None:
    """Runs the course and appends each run to `done`."""
    total, failed = run_count(course, controls), 0
    with (
        counting_bar("benchmark", total, plain=True) as count,
        closing(run_course(course, controls, gains=gains, workers=workers)) as runs,
    ):
        count(0)
        for run in runs:
            done.append(run)
            failed += not run.success
            count(len(done), failed)


def _show(table: Table) -> None:
    """Prints the tables of a course."""
    course = table.course
    show_text(
        f"Course {course.version} ({course.hash[:12]}), split {course.split}, "
        f"{len(course.cases)} cases, {len(course.seeds)} seeds; reference {table.reference}"
    )
    for title, (columns, rows) in _tables(table):
        if rows:
            show_text(f"\n{title}")
            show_table(columns, rows)


def _tables(table: Table) -> list[tuple[str, tuple[list[str], list[list[str]]]]]:
    """Returns the titles and contents of the printed tables."""
    return [
        ("Means over the successful runs ± half a 95 % interval", texts.case_rows(table)),
        ("Failures", texts.failure_rows(table)),
        ("Success over the height of steps and roughness", texts.sweep_rows(table)),
        (
            f"Medians over cases of the change from {table.reference} (95 % interval)",
            texts.class_rows(table),
        ),
        ("Goals", texts.goal_rows([each for each in verdicts(table) if each.was_run])),
    ]


def _checked_controls(names: Sequence[str]) -> tuple[str, ...]:
    """Returns the controls. Raises CourseError for an unknown or repeated one."""
    for name in names:
        if name not in CONTROLS:
            raise unknown_name("control", name, CONTROLS, where="--control", error=CourseError)
    if len(set(names)) < len(names):
        raise CourseError(
            "the same control twice",
            got=list(names),
            expected="each control once",
            fix="leave out one of them",
            where="--control",
        )
    return tuple(names)


def _check_number(value: int | None, most: int, where: str) -> None:
    """Raises CourseError for a given number that is not from 1 to `most`."""
    if value is not None and not 1 <= value <= most:
        raise CourseError("number out of range", got=value, expected=f"1 to {most}", where=where)


def _command_line(options: Mapping[str, Any], *, split: str, quick: bool) -> str:
    """Returns the command that repeats the benchmark."""
    words = ["hexapod", "benchmark", "--split", split, *(["--quick"] if quick else [])]
    for name, value in options.items():
        for item in value if isinstance(value, list) else [value]:
            words += [] if item is None else [f"--{name}", str(item)]
    return shlex.join(words)
