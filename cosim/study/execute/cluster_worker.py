"""What runs on a worker of a Dask cluster: the job, sent there once, and its chunks."""

from __future__ import annotations

import asyncio
from typing import Any

from hexapod_cosim.cosim.study.execute.crew import Chunk
from hexapod_cosim.cosim.study.execute.job import Job
from hexapod_cosim.cosim.study.execute.worker import close_workshop, work
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.cosim.study.store.done import Done

_jobs: dict[str, Job] = {}  # of this process, by their names


def job_plugin(job: Job) -> Any:
    """What puts the job on every worker, those too that come later or begin anew, and takes it
    away again.
    """
    from distributed import WorkerPlugin  # noqa: PLC0415  an extra

    class JobPlugin(WorkerPlugin):  # type: ignore[misc]  # untyped
        def setup(self, worker: Any) -> None:
            take_job(job)

        async def teardown(self, worker: Any) -> None:
            await asyncio.to_thread(drop_job, job.name)  # may wait for a run to end

    return JobPlugin()


def take_job(job: Job) -> None:
    """Before a job's first chunk: a function of its own, since the plugin travels by value and
    would bring its own `_jobs`.
    """
    _jobs[job.name] = job


def drop_job(job: str) -> None:
    """Forgets a job; a run of it that is under way ends."""
    _jobs.pop(job, None)
    close_workshop(job)


def work_here(job: str, chunk: Chunk) -> list[Done]:
    """Runs a chunk on a worker that has the job. Raises StudyError on one that does not."""
    if job not in _jobs:
        raise StudyError(
            "a worker of the cluster did not get the study's job",
            fix="look into its log, and start it again",
        )

    def progress(_done: float) -> None:
        if job not in _jobs:
            raise KeyboardInterrupt

    return work(_jobs[job], chunk.orders, progress)
