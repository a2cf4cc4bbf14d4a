"""Runs a study for `hexapod study` and shows its results.

The command itself is in study_command.py, because the imports of this module take a second.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from hexapod_cosim.cosim.cli.failures import FELL, SUCCESS
from hexapod_cosim.cosim.cli.terminal import (
    counting_bar,
    show_files,
    show_json,
    show_table,
    show_text,
    warn,
)
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.comparison import METHOD
from hexapod_cosim.extensions.study.dispatch import ProgressSink
from hexapod_cosim.extensions.study.reading import load_study
from hexapod_cosim.extensions.study.report import tables
from hexapod_cosim.extensions.study.report.notes import notes
from hexapod_cosim.extensions.study.report.page import write_study_report
from hexapod_cosim.extensions.study.study import Options, StartProgress, run_study
from hexapod_cosim.extensions.study.summary import Results, read_results, summary_of

MAX_REASONS = 10  # of failures that are shown


def run_and_report(
    file: str, folder: Path, options: Options, *, controls: Sequence[str] = (), json: bool
) -> int:
    """Runs a study, or what is missing of it, writes its report and shows the results.

    `controls` replace those of the file.

    Returns:
        The exit code of the command.
    """
    plan = load_study(file, controls=controls)
    try:
        with progress(plain=not json) as start:
            results = run_study(plan, folder, options=options, start=start)
    except KeyboardInterrupt:
        warn(f"stopped; the runs so far are in {folder}, and the same command resumes the study")
        raise
    found, files = report_on(folder)
    warn_of(found)
    if json:
        show_json({**summary_of(found), "results": str(results), "report": str(files[-1])})
    else:
        show_study(found)
        show_files([results, *files])
        print(f"report: {files[-1]}")
    return FELL if _only_falls(found) else SUCCESS


def _only_falls(found: Results) -> bool:
    """Returns whether no run walked to its end and the robot fell in some of them."""
    return not any(found.overall.walked.values()) and any(
        status == COMPLETED for _, status, _ in found.failures
    )


def warn_of(found: Results) -> None:
    """Prints the notes of the report as warnings."""
    for text in notes(found):
        warn(text)


def report_on(folder: Path) -> tuple[Results, list[Path]]:
    """Reads a study's folder and writes its tables and report; returns the results and files."""
    found = read_results(folder)
    return found, write_study_report(found, folder)


@contextmanager
def progress(*, plain: bool) -> Iterator[StartProgress]:
    """Yields a function that starts the display of progress when the number of runs is known.

    The display is a bar with rate, remaining time and failures on a terminal, and lines elsewhere
    if `plain`.
    """
    with ExitStack() as shown:

        def start(total: int, done: int) -> ProgressSink:
            if done:
                print(f"resumed: {done} of {total} runs are there already", file=sys.stderr)
            show = shown.enter_context(counting_bar("runs", total, plain=plain))
            show(done, 0)
            count, failed = done, 0

            def add(more: int, lost: int) -> None:
                nonlocal count, failed
                count, failed = count + more, failed + lost
                show(count, failed)

            return add

        yield start


def show_study(found: Results) -> None:
    """Prints the table of all runs, totals, failures by reason and the optimum."""
    overall, controls = found.overall, found.study.controls
    _show(tables.overall_table(found))
    walked = ", ".join(
        f"{control} {overall.walked[control]} of {overall.runs[control]}" for control in controls
    )
    show_text(f"{found.runs} runs at {found.of_points} points; walked to the end: {walked}")
    if len(controls) > 1:
        show_text(f"{METHOD}.")
    for count, control, how, reason in tables.failure_table(found).rows[:MAX_REASONS]:
        show_text(f"{count:>6} x {control} {how}: {reason}")
    if found.optimum is not None:
        _show(tables.optimum_table(found))
        _show(tables.optimum_changes(found))


def _show(table: tables.Table) -> None:
    show_table(table.columns, table.rows, right=table.right)
