"""Runs a study, or the part of it that is missing, and writes its results."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.common.events import EventSink, ignore_event
from hexapod_cosim.cosim.common.files import read_json
from hexapod_cosim.cosim.run.worker_pool import processor_count
from hexapod_cosim.cosim.study.execute.chunk import ChunkExecutor
from hexapod_cosim.cosim.study.execute.dispatch import (
    ProgressSink,
    ResultSink,
    dispatch,
    missing_runs,
)
from hexapod_cosim.cosim.study.execute.engines import DEFAULT_ENGINE
from hexapod_cosim.cosim.study.execute.job import Job, make_job, manifest_of
from hexapod_cosim.cosim.study.execute.local import in_process_executor, local_executor
from hexapod_cosim.cosim.study.execute.optimise import optimise
from hexapod_cosim.cosim.study.plan.optimisation import Optimisation
from hexapod_cosim.cosim.study.plan.points import Sweep
from hexapod_cosim.cosim.study.plan.records import Study
from hexapod_cosim.cosim.study.store.columns import WALL, result_schema, schema_of
from hexapod_cosim.cosim.study.store.manifest import (
    MANIFEST,
    RESULTS,
    RUNS,
    TIMES,
    begin_folder,
    finish_folder,
    locked,
    provenance,
    remove_unfinished,
)
from hexapod_cosim.cosim.study.store.results import POINTS, SUMMARY
from hexapod_cosim.cosim.study.store.store import Store, Writer, write_durably, write_whole

# gets the numbers of all runs and of those that are done, and returns the display of progress
StartProgress = Callable[[int, int], ProgressSink]


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a study is run. Results depend on the engine, the FMU and the gains only."""

    engine: str = DEFAULT_ENGINE
    fmu: Path | None = None
    gains: Gains | None = None
    # number of processes; None: one for each processor; 0: the calling process runs everything
    workers: int | None = None
    scheduler: str | None = None  # address of a Dask scheduler that replaces the processes
    command: str = ""  # command line that repeats the study, for its report
    write: Writer = write_durably
    events: EventSink = ignore_event  # for instance that the study waits for workers


def run_study(study: Study, folder: Path, *, options: Options, start: StartProgress) -> Path:
    """Runs the runs of a study that the folder does not hold and writes all results.

    Raises HexapodError for a folder of something else, a full disk or a cluster that is gone. All
    runs stored so far are kept.

    Args:
        start: function that is called when the number of runs is known.

    Returns:
        The file of results.
    """
    with locked(folder):
        job = make_job(study, engine=options.engine, fmu=options.fmu, gains=options.gains)
        begin_folder(
            folder, manifest_of(study, job, runs=count_runs(study)), command=options.command
        )
        remove_unfinished(folder, shared=(POINTS, SUMMARY))
        store = Store(folder / RUNS, schema_of(study), write=options.write)
        store.prepare(count_runs(study), events=options.events)
        if study.optimise is None:
            _sweep(study, store, job, options, start)
        else:
            count = count_runs(study)
            progress = start(count, int(np.count_nonzero(store.done(count))))
            with open_executor(job, options, study) as executor:
                optimise(ResultSink(study, store, progress), executor, folder)
        write_results(study, store, folder)
        finish_folder(folder)
    return folder / RESULTS


def count_runs(study: Study) -> int:
    """Returns the number of runs of a study, for an optimisation the largest possible one."""
    return Sweep(study).count if study.optimise is None else Optimisation(study).most


def _sweep(study: Study, store: Store, job: Job, options: Options, start: StartProgress) -> None:
    """Runs what is missing of a study without an optimiser."""
    sweep = Sweep(study)
    done = store.done(sweep.count)
    progress = start(sweep.count, int(np.count_nonzero(done)))
    if done.all():
        return
    orders = sweep.orders(missing_runs(done))
    with (
        open_executor(job, options, study) as executor,
        closing(dispatch(ResultSink(study, store, progress), executor, orders)) as results,
    ):
        for _ in results:
            pass


def open_executor(
    job: Job, options: Options, study: Study
) -> AbstractContextManager[ChunkExecutor]:
    """Opens the executor that the options ask for."""
    if options.scheduler is not None:
        # an extra
        from hexapod_cosim.cosim.study.execute.cluster import cluster_executor  # noqa: PLC0415

        return cluster_executor(job, options.scheduler, options.events)
    if options.workers == 0:
        return in_process_executor(job)
    return local_executor(job, min(options.workers or processor_count(), count_runs(study)))


def write_results(study: Study, store: Store, folder: Path) -> None:
    """Writes results.parquet and times.parquet, with all runs in the order of their numbers.

    results.parquet has the same bytes however the runs were executed; times.parquet holds the
    time of each run.
    """
    schema = schema_of(study)
    facts = provenance(read_json(folder / MANIFEST))
    write_whole(folder / RESULTS, store.sorted_rows(), result_schema(schema).with_metadata(facts))
    write_whole(
        folder / TIMES, store.sorted_rows(), pa.schema([schema.field("run"), schema.field(WALL)])
    )
