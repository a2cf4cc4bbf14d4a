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
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from time import monotonic
from typing import Any

from hexapod_cosim.cosim.common.events import EventSink
from hexapod_cosim.cosim.common.files import not_writable
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.master.interrupts import remembered_interrupts
from hexapod_cosim.cosim.run.worker_pool import SerialExecutor, WorkerDiedError, WorkerPool
from hexapod_cosim.extensions.study.job import Job
from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.extensions.study.worker import close_job_contexts, unpack_job

CONNECT_TIMEOUT = "10s"
ADDRESS = re.compile(r"[a-z]+://\S+")  # PROTOCOL://HOST:PORT, as Dask writes it
NO_WORKER_TIMEOUT = 60.0  # s    without any worker, after which the study stops
COUNT_INTERVAL = 1.0  # s    between requests for the number of workers
FIX_RESUME = "start the study again when it is back; it continues, and all stored runs are kept"


@dataclass(frozen=True)
class Workers:
    """An executor that runs the orders of a job, see worker.run_orders()."""

    executor: Executor
    job: Any  # the job, the file that holds it, or a future of Dask for it
    size: Callable[[], int]  # number of workers now, at least 1
    deaths: tuple[type[Exception], ...]  # exceptions of a task whose workers died
    check: Callable[[], None]  # raises KeyboardInterrupt, or StudyError when no worker is left


@contextmanager
def in_process_workers(job: Job) -> Iterator[Workers]:
    """Runs everything in this process.

    No process is started, which suits debuggers; a run that ends its process ends the study.
    """
    try:
        yield Workers(SerialExecutor(), job, lambda: 1, (), lambda: None)
    finally:
        close_job_contexts()


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
            yield Workers(pool, file, lambda: count, (WorkerDiedError,), lambda: None)


@contextmanager
def cluster_workers(job: Job, address: str, events: EventSink) -> Iterator[Workers]:
    """Runs chunks on the workers of a Dask scheduler, given its address.

    Raises StudyError when no scheduler answers.
    """
    client = _connect(address)
    from distributed import KilledWorker  # noqa: PLC0415  an extra

    with ExitStack() as opened:
        opened.callback(_suppress_errors, client.close, timeout=5)
        # its tracebacks of a dead scheduler say no more than our error does
        opened.enter_context(_silenced("distributed"))
        check_interrupts = opened.enter_context(remembered_interrupts())
        count = _WorkerCount(client, events)

        def check() -> None:
            check_interrupts()
            count.update()

        # a task, because Dask repeats it when the worker that holds its result dies
        sent = client.submit(unpack_job, pickle.dumps(job), key=f"hexapod-{job.name}", pure=False)
        executor = client.get_executor(pure=False)
        yield Workers(executor, sent, lambda: max(count.value, 1), (KilledWorker,), check)


class _WorkerCount:
    """The number of workers that a client sees."""

    def __init__(self, client: Any, events: EventSink) -> None:
        self._client, self._events = client, events
        self._asked, self._seen = -COUNT_INTERVAL, monotonic()  # s    of the last request, worker
        self._warned = False  # that there are no workers
        self.value = 0
        self.update()

    def update(self) -> None:
        """Asks the scheduler, when it is due.

        Raises StudyError when the scheduler is gone, or when there was no worker for
        NO_WORKER_TIMEOUT.
        """
        now = monotonic()
        if now - self._asked < COUNT_INTERVAL:
            return
        try:
            if self._client.status != "running":
                raise OSError(f"the client is {self._client.status}")
            self.value = len(self._client.nthreads())
        except (OSError, RuntimeError, TimeoutError) as error:
            raise StudyError(
                "the cluster is gone",
                got=f"{type(error).__name__}: {error}",
                expected="a scheduler with workers",
                fix=FIX_RESUME,
            ) from error
        self._asked = now
        if self.value:
            self._seen, self._warned = now, False
        elif now - self._seen > NO_WORKER_TIMEOUT:
            raise _no_workers(self._client.scheduler.address)
        elif not self._warned:
            self._warned = True
            self._events(
                f"the cluster has no workers: waiting for some, {NO_WORKER_TIMEOUT:g} s at most"
            )


def _no_workers(address: str) -> StudyError:
    fix = f"start some: dask worker {address} --nthreads 1; all runs stored so far are kept"
    return StudyError(
        "the cluster has no workers",
        got=f"none for {NO_WORKER_TIMEOUT:g} s",
        expected="one at least",
        fix=fix,
    )


def unfit_worker(error: Exception) -> StudyError:
    """Returns the error for a worker that can run no chunk."""
    return StudyError(
        "a worker cannot run the study",
        got=f"{type(error).__name__}: {error}",
        fix="install the same versions on all machines of the cluster",
    )


def _connect(address: str) -> Any:
    try:
        from distributed import Client  # noqa: PLC0415  an extra
    except ImportError as error:
        raise StudyError(
            "Dask is not installed", fix=install_extra("cluster"), where="--scheduler"
        ) from error
    if not ADDRESS.fullmatch(address):
        raise _no_scheduler("not an address of a scheduler", address)
    try:
        return Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise _no_scheduler("no scheduler answers", address) from error


def _no_scheduler(what: str, address: str) -> StudyError:
    return StudyError(
        what,
        got=address,
        expected="tcp://HOST:8786 of a Dask scheduler",
        fix="start one with `dask scheduler`, which prints its address",
        where="--scheduler",
    )


@contextmanager
def _silenced(name: str) -> Iterator[None]:
    """Suppresses the log messages of a library within the block."""
    log = logging.getLogger(name)
    before = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(before)


def _suppress_errors(act: Callable[..., Any], *arguments: Any, **options: Any) -> None:
    with suppress(Exception):
        act(*arguments, **options)
