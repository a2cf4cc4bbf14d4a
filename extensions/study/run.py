"""Runs a study, or what is missing of it, for `hexapod study`, and shows its results.

The command is in command.py, because the imports of this module take a second.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from hexapod_cosim.controller import Gains
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
from hexapod_cosim.cosim.results.folder import locked
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.extensions.study.dispatch import (
    ProgressSink,
    ResultSink,
    Workers,
    cluster_workers,
    dispatch,
    local_workers,
)
from hexapod_cosim.extensions.study.folder import RESULTS, begin_folder, export_runs, finish_folder
from hexapod_cosim.extensions.study.job import make_job, manifest_of
from hexapod_cosim.extensions.study.orders import count_runs, sweep_orders
from hexapod_cosim.extensions.study.page import (
    Table,
    best_settings,
    failure_table,
    notes,
    optimum_table,
    overall_table,
    shown_walks,
    write_study_report,
)
from hexapod_cosim.extensions.study.reading import load_study
from hexapod_cosim.extensions.study.records import Study
from hexapod_cosim.extensions.study.search import optimise
from hexapod_cosim.extensions.study.store import Store
from hexapod_cosim.extensions.study.summary import Results, read_results, summary_of

MAX_REASONS = 10  # of failures that are shown
# opens the display of progress for a number of runs
Progress = Callable[[int], AbstractContextManager[ProgressSink]]


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a study is run. Results depend on the FMU and the gains only."""

    fmu: Path | None = None
    gains: Gains | None = None
    # number of processes; None: one for each processor; 0: the calling process runs everything
    workers: int | None = None
    scheduler: str | None = None  # address of a Dask scheduler that replaces the processes
    command: str = ""  # command line that repeats the study, for its report
    runner: type[Runner] = Runner  # a class that workers can import


def run_study(study: Study, folder: Path, *, options: Options, progress: Progress) -> Path:
    """Runs the runs of a study that the folder does not hold and writes all results.

    Raises HexapodError for a folder of something else, a full disk or a cluster that is gone. All
    runs stored so far are kept.

    Returns:
        The file of results.
    """
    count = count_runs(study)
    job = make_job(study, fmu=options.fmu, gains=options.gains, runner=options.runner)
    begin_folder(folder, manifest_of(study, job, runs=count), command=options.command)
    with locked(folder), closing(Store(folder, study)) as store, progress(count) as show:
        missing = np.flatnonzero(~store.done(count))
        done = count - len(missing)
        if done:
            print(f"resumed: {done} of {count} runs are there already", file=sys.stderr)
        show(done, 0)
        sink = ResultSink(job, store, show, done)
        with open_workers(options, count) as workers:
            if study.optimise is not None:
                optimise(study, sink, workers, folder)
            else:
                orders = sweep_orders(study, map(int, missing))
                dispatch(sink, workers, orders, len(missing))
        export_runs(store, folder)
    finish_folder(folder)
    return folder / RESULTS


def open_workers(options: Options, count: int) -> AbstractContextManager[Workers]:
    """Opens the workers that the options ask for, for a number of runs."""
    if options.scheduler is not None:
        return cluster_workers(options.scheduler)
    wanted = processor_count() if options.workers is None else options.workers
    return local_workers(min(wanted, count))


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
        progress = partial(counting_bar, "runs", plain=not json)
        results = run_study(plan, folder, options=options, progress=progress)
    except KeyboardInterrupt:
        warn(f"stopped; the runs so far are in {folder}, and the same command resumes the study")
        raise
    found, files = report_on(folder)
    if json:
        show_json({**summary_of(found), "results": str(results), "report": str(files[-1])})
    else:
        show_study(found)
        show_files([results, *files])
        print(f"report: {files[-1]}")
    fell = any(status == COMPLETED for _, status, _ in found.failures)
    return FELL if fell and not any(found.overall.walked.values()) else SUCCESS


def report_on(folder: Path) -> tuple[Results, list[Path]]:
    """Reads a study's folder, writes its tables and report, and prints the notes as warnings.

    Returns the results and the files.
    """
    found = read_results(folder)
    files = write_study_report(found, folder)
    for text in notes(found):
        warn(text)
    return found, files


def show_study(found: Results) -> None:
    """Prints the table of all runs, totals, failures by reason and the optimum."""
    _show(overall_table(found))
    show_text(
        f"{found.runs} runs at {found.of_points} points; walked to the end: {shown_walks(found)}"
    )
    if len(found.study.controls) > 1:
        show_text(f"{METHOD}.")
    for count, control, how, reason in failure_table(found).rows[:MAX_REASONS]:
        show_text(f"{count:>6} x {control} {how}: {reason}")
    if found.optimum is not None:
        show_text(best_settings(found))
        _show(optimum_table(found))


def _show(table: Table) -> None:
    show_table(table.columns, table.rows, right=table.right)
