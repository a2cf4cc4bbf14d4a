"""Runs a study, or the part of it that is missing, and writes its results."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.extensions.study.dispatch import ProgressSink, ResultSink, dispatch
from hexapod_cosim.extensions.study.folder import (
    RESULTS,
    begin_folder,
    export_runs,
    finish_folder,
    locked,
)
from hexapod_cosim.extensions.study.job import Job, make_job, manifest_of
from hexapod_cosim.extensions.study.records import Study
from hexapod_cosim.extensions.study.runs import Sweep, count_runs
from hexapod_cosim.extensions.study.search import optimise
from hexapod_cosim.extensions.study.store import Store
from hexapod_cosim.extensions.study.workers import (
    EventSink,
    Workers,
    cluster_workers,
    in_process_workers,
    local_workers,
)

# gets the numbers of all runs and of those that are done, and returns the display of progress
StartProgress = Callable[[int, int], ProgressSink]


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a study is run. Results depend on the FMU and the gains only."""

    fmu: Path | None = None
    gains: Gains | None = None
    # number of processes; None: one for each processor; 0: the calling process runs everything
    workers: int | None = None
    scheduler: str | None = None  # address of a Dask scheduler that replaces the processes
    command: str = ""  # command line that repeats the study, for its report
    events: EventSink = lambda _text: None  # for instance that the study waits for workers
    runner: type[Walker] = Walker  # a class that workers can import


def run_study(study: Study, folder: Path, *, options: Options, start: StartProgress) -> Path:
    """Runs the runs of a study that the folder does not hold and writes all results.

    Raises HexapodError for a folder of something else, a full disk or a cluster that is gone. All
    runs stored so far are kept.

    Args:
        start: function that is called when the number of runs is known.

    Returns:
        The file of results.
    """
    count = count_runs(study)
    with locked(folder):
        job = make_job(study, fmu=options.fmu, gains=options.gains, runner=options.runner)
        begin_folder(folder, manifest_of(job, runs=count), command=options.command)
        with closing(Store(folder, study)) as store:
            done = store.done(count)
            sink = ResultSink(study, store, start(count, int(np.count_nonzero(done))))
            if study.optimise is not None:
                with open_workers(job, options, count) as workers:
                    optimise(sink, workers, folder)
            elif not done.all():
                missing = np.flatnonzero(~done)
                orders = Sweep(study).orders(map(int, missing))
                with open_workers(job, options, count) as workers:
                    dispatch(sink, workers, orders, len(missing))
            export_runs(store, folder)
        finish_folder(folder)
    return folder / RESULTS


def open_workers(job: Job, options: Options, count: int) -> AbstractContextManager[Workers]:
    """Opens the workers that the options ask for, for a number of runs."""
    if options.scheduler is not None:
        return cluster_workers(job, options.scheduler, options.events)
    if options.workers == 0:
        return in_process_workers(job)
    return local_workers(job, min(options.workers or processor_count(), count))
