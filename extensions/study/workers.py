"""Opens the workers of a study: this process, processes of this machine, or a Dask cluster.

All are executors of `concurrent.futures`. On a cluster Dask places the chunks, moves them from
workers that die to others, and sends them the job.
"""

from __future__ import annotations

import logging
import pickle
import re
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.common.files import not_writable
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.master.interrupts import remembered_interrupts
from hexapod_cosim.cosim.run.worker_pool import SerialExecutor, WorkerDiedError, WorkerPool
from hexapod_cosim.extensions.study.job import Job
from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.extensions.study.worker import close_job_context, unpack_job

EventSink = Callable[[str], None]  # receives messages about waiting and corrections
CONNECT_TIMEOUT = "10s"
ADDRESS = re.compile(r"[a-z]+://\S+")  # PROTOCOL://HOST:PORT, as Dask writes it
FIX_RESUME = "start the study again when it is back; it continues, and all stored runs are kept"


@dataclass(frozen=True)
class Workers:
    """An executor that runs the orders of a job, see worker.run_orders()."""

    executor: Executor
    job: Any  # the job, the file that holds it, or a future of Dask for it
    size: Callable[[], int]  # number of workers now, at least 1
    deaths: tuple[type[Exception], ...] = ()  # exceptions of a task whose workers died
    check: Callable[[], None] = lambda: None  # raises KeyboardInterrupt after Ctrl-C


@contextmanager
def in_process_workers(job: Job) -> Iterator[Workers]:
    """Runs everything in this process.

    No process is started, which suits debuggers; a run that ends its process ends the study.
    """
    try:
        yield Workers(SerialExecutor(), job, lambda: 1)
    finally:
        close_job_context()


@contextmanager
def local_workers(job: Job, count: int) -> Iterator[Workers]:
    """Runs chunks in worker processes, which have ended when the block ends.

    They read the job from a file. Raises HexapodError when the disk has no room for it.
    """
    with TemporaryFolder("workers") as folder:
        file = folder / "job"
        try:
            file.write_bytes(pickle.dumps(job))
        except OSError as error:
            raise not_writable(file, error) from error
        with WorkerPool(count, scratch=folder) as pool:
            yield Workers(pool, file, lambda: count, (WorkerDiedError,))


@contextmanager
def cluster_workers(job: Job, address: str, events: EventSink) -> Iterator[Workers]:
    """Runs chunks on the workers of a Dask scheduler, given its address.

    Raises StudyError when no scheduler answers.
    """
    client = _connect(address)
    from distributed import KilledWorker  # noqa: PLC0415  an extra

    with ExitStack() as opened:
        opened.callback(client.close, timeout=5)
        # its tracebacks of a dead scheduler say no more than our error does
        logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)
        interrupts = opened.enter_context(remembered_interrupts())
        size = _cluster_size(client, events)
        # a task, because Dask repeats it when the worker that holds its result dies
        sent = client.submit(unpack_job, pickle.dumps(job), key=f"hexapod-{job.name}", pure=False)
        executor = client.get_executor(pure=False)
        yield Workers(executor, sent, size, (KilledWorker,), interrupts)


def _cluster_size(client: Any, events: EventSink) -> Callable[[], int]:
    """Returns a function that returns the number of workers, or 1 while Dask waits for some.

    It raises StudyError when the scheduler is gone.
    """
    before = 1

    def size() -> int:
        nonlocal before
        before, last = _worker_count(client), before
        if last and not before:
            address = client.scheduler.address
            events(f"the cluster has no workers: waiting for some (dask worker {address})")
        return max(before, 1)

    return size


def _worker_count(client: Any) -> int:
    """Returns the number of workers of a cluster. Raises StudyError when its scheduler is gone."""
    try:
        if client.status != "running":
            raise OSError(f"the client is {client.status}")
        return len(client.nthreads())
    except (OSError, RuntimeError, TimeoutError) as error:
        raise StudyError(
            "the cluster is gone",
            got=f"{type(error).__name__}: {error}",
            expected="a scheduler with workers",
            fix=FIX_RESUME,
        ) from error


def _connect(address: str) -> Any:
    try:
        from distributed import Client  # noqa: PLC0415  an extra
    except ImportError as error:
        what, fix = "Dask is not installed", install_extra("cluster")
        raise StudyError(what, fix=fix, where="--scheduler") from error
    try:
        if not ADDRESS.fullmatch(address):
            raise ValueError
        return Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise StudyError(
            "no scheduler answers",
            got=address,
            expected="tcp://HOST:8786 of a Dask scheduler",
            fix="start one with `dask scheduler`, which prints its address",
            where="--scheduler",
        ) from error
