"""Executes the chunks of a study on this machine, in worker processes or in the calling one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from multiprocessing.util import Finalize
from pathlib import Path

from hexapod_cosim.cosim.run.worker_pool import (
    InProcessExecutor,
    raise_if_stopped,
    worker_pool,
)
from hexapod_cosim.cosim.study.execute.chunk import Chunk, ChunkExecutor
from hexapod_cosim.cosim.study.execute.job import Job
from hexapod_cosim.cosim.study.execute.scratch import read_job, scratch_folder
from hexapod_cosim.cosim.study.execute.worker import close_job_context, run_orders
from hexapod_cosim.cosim.study.store.run_result import RunResult

_job: Job | None = None  # set in worker processes only


@contextmanager
def in_process_executor(job: Job) -> Iterator[ChunkExecutor]:
    """Runs chunks in this process.

    No process is started, which suits debuggers; a run that ends its process ends the study.
    """
    try:
        yield InProcessExecutor(partial(_run_here, job))
    finally:
        close_job_context(job.name)


@contextmanager
def local_executor(job: Job, workers: int) -> Iterator[ChunkExecutor]:
    """Runs chunks in worker processes, which have ended when the block ends."""
    with (
        scratch_folder(job) as folder,
        worker_pool(
            workers, _run_in_worker, initialise=partial(_load_job, folder), scratch=folder
        ) as pool,
    ):
        yield pool


def _run_here(job: Job, chunk: Chunk) -> list[RunResult]:
    """Runs a chunk in this process. Raises KeyboardInterrupt when a run was interrupted."""
    results = run_orders(job, chunk.orders, raise_if_stopped)
    if len(results) < len(chunk.orders):
        raise KeyboardInterrupt
    return results


def _load_job(folder: Path) -> None:
    """Reads the job in a new worker process.

    The job is not sent to the process: it would fill the pipe to one that dies before it reads,
    and the pool would wait for that pipe without end.
    """
    global _job  # noqa: PLW0603  a worker process belongs to one study
    _job = read_job(folder)
    Finalize(None, close_job_context, args=(_job.name,), exitpriority=10)


def _run_in_worker(chunk: Chunk) -> list[RunResult]:
    assert _job is not None  # _load_job was called before
    return run_orders(_job, chunk.orders, raise_if_stopped)
