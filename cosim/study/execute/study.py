"""A study from its file to its results, wherever it was left."""

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
from hexapod_cosim.cosim.run.batch import processors
from hexapod_cosim.cosim.study.execute.conduct import Desk, conduct, missing
from hexapod_cosim.cosim.study.execute.crew import Crew
from hexapod_cosim.cosim.study.execute.engines import DEFAULT_ENGINE
from hexapod_cosim.cosim.study.execute.job import Job, make_job, manifest_of
from hexapod_cosim.cosim.study.execute.optimise import optimise
from hexapod_cosim.cosim.study.execute.pool import local_crew, own_crew
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
    clear_leftovers,
    finish_folder,
    locked,
    provenance,
)
from hexapod_cosim.cosim.study.store.results import POINTS, SUMMARY
from hexapod_cosim.cosim.study.store.store import Store, Writer, write_durably, write_whole

Begun = Callable[
    [int, int], Callable[[int, int], None]
]  # runs in all, of them done already -> who is told of progress


@dataclass(frozen=True, kw_only=True)
class Options:
    """How a study is run; none of it but the engine, FMU and gains shows in the results."""

    engine: str = DEFAULT_ENGINE
    fmu: Path | None = None
    gains: Gains | None = None
    workers: int | None = (
        # processes; None: one for each processor; 0: this one does it, and ends with a walk that
        # ends it
        None
    )
    scheduler: str | None = None  # a Dask scheduler's address instead
    command: str = ""
    write: Writer = write_durably
    say: EventSink = ignore_event  # e.g. that workers are waited for


def run_study(study: Study, folder: Path, *, options: Options, begun: Begun) -> Path:
    """Runs what of a study is not in the folder yet, and puts it all together. Returns the file of
    results.

    Raises HexapodError: a folder of something else, a full disk, a cluster that is gone. All that
    was stored is kept.
    """
    with locked(folder):
        job = make_job(study, engine=options.engine, fmu=options.fmu, gains=options.gains)
        begin_folder(
            folder, manifest_of(study, job, runs=count_runs(study)), command=options.command
        )
        clear_leftovers(folder, shared=(POINTS, SUMMARY))
        store = Store(folder / RUNS, schema_of(study), write=options.write)
        store.prepare(count_runs(study), say=options.say)
        if study.optimise is None:
            _sweep(study, store, job, options, begun)
        else:
            tell = begun(count_runs(study), int(np.count_nonzero(store.done(count_runs(study)))))
            with crew_of(job, options, study) as crew:
                optimise(Desk(study, store, tell), crew, folder)
        put_together(study, store, folder)
        finish_folder(folder)
    return folder / RESULTS


def count_runs(study: Study) -> int:
    """All runs of a study; of an optimisation the most there may be."""
    return Sweep(study).count if study.optimise is None else Optimisation(study).most


def _sweep(study: Study, store: Store, job: Job, options: Options, begun: Begun) -> None:
    sweep = Sweep(study)
    done = store.done(sweep.count)
    tell = begun(sweep.count, int(np.count_nonzero(done)))
    if done.all():
        return
    orders = sweep.orders(missing(done))
    with (
        crew_of(job, options, study) as crew,
        closing(conduct(Desk(study, store, tell), crew, orders)) as results,
    ):
        for _ in results:
            pass


def crew_of(job: Job, options: Options, study: Study) -> AbstractContextManager[Crew]:
    """The workers that the options name."""
    if options.scheduler is not None:
        # an extra
        from hexapod_cosim.cosim.study.execute.cluster import cluster_crew  # noqa: PLC0415

        return cluster_crew(job, options.scheduler, options.say)
    if options.workers == 0:
        return own_crew(job)
    return local_crew(job, min(options.workers or processors(), count_runs(study)))


def put_together(study: Study, store: Store, folder: Path) -> None:
    """results.parquet, all runs in the order of their numbers, the same bytes however they were
    run; times.parquet, what they took.
    """
    schema = schema_of(study)
    facts = provenance(read_json(folder / MANIFEST))
    write_whole(folder / RESULTS, store.sorted_rows(), result_schema(schema).with_metadata(facts))
    write_whole(
        folder / TIMES, store.sorted_rows(), pa.schema([schema.field("run"), schema.field(WALL)])
    )
