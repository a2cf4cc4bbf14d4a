"""Runs chunks on a worker of a Dask cluster, to which the job is sent once."""

from __future__ import annotations

import asyncio
from typing import Any

from hexapod_cosim.cosim.study.execute.chunk import Chunk
from hexapod_cosim.cosim.study.execute.job import Job
from hexapod_cosim.cosim.study.execute.worker import close_job_context, run_orders
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.cosim.study.store.run_result import RunResult

_jobs: dict[str, Job] = {}  # the jobs of this process by name


def job_plugin(job: Job) -> Any:
    """Returns the Dask plugin that installs the job on every worker and removes it at the end.

    Workers that join later or restart get it as well.
    """
    from distributed import WorkerPlugin  # noqa: PLC0415  an extra

    class JobPlugin(WorkerPlugin):  # type: ignore[misc]  # untyped
        def setup(self, worker: Any) -> None:
            install_job(job)

        async def teardown(self, worker: Any) -> None:
            await asyncio.to_thread(remove_job, job.name)  # may wait for a run to end

    return JobPlugin()


def install_job(job: Job) -> None:
    """Keeps a job for its chunks.

    This is a function of the module because the plugin is sent by value: within it, `_jobs`
    would be another dictionary.
    """
    _jobs[job.name] = job


def remove_job(job: str) -> None:
    """Removes a job by its name; a run of it that is under way ends."""
    _jobs.pop(job, None)
    close_job_context(job)


def run_chunk(job: str, chunk: Chunk) -> list[RunResult]:
    """Runs a chunk of a job, given by its name. Raises StudyError when the job is not here."""
    if job not in _jobs:
        raise StudyError(
            "a worker of the cluster did not get the study's job",
            fix="look into its log, and start it again",
        )

    def progress(_done: float) -> None:
        if job not in _jobs:
            raise KeyboardInterrupt

    return run_orders(_jobs[job], chunk.orders, progress)
