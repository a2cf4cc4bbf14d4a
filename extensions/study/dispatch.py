"""Runs the orders of a study in chunks on an executor of `concurrent.futures`.

The executor is this process, processes of this machine, or a Dask cluster. Orders are made when a
worker has room for them, and rows are written to the disk in parts, so memory does not grow with
the number of runs, except for a byte for each that marks it as done. The result of a run depends on
its order alone, and so neither on the workers nor on the chunks nor on how often the study was
killed.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any

from hexapod_cosim.cosim.cli.terminal import warn
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.run.worker_pool import SerialExecutor, WorkerDiedError, WorkerPool
from hexapod_cosim.extensions.study.job import Job
from hexapod_cosim.extensions.study.records import Order, RunResult, StudyError
from hexapod_cosim.extensions.study.rules import require
from hexapod_cosim.extensions.study.store import Store
from hexapod_cosim.extensions.study.worker import close_runners, run_orders, summary_without_figures

MAX_CHUNK = 16  # runs: half a second of work, so that a dead worker loses little
CHUNKS_PER_WORKER = 2  # a worker that finishes a chunk has the next one already
CHECK_INTERVAL = 0.5  # s    between checks for workers
CONNECT_TIMEOUT = "10s"
MAX_DEATHS_IN_A_ROW = 10  # chunks: more are not caused by single runs
FIX_DEATHS = "look for what ends them (memory?); a script needs `if __name__ == '__main__':`"
FIX_RESUME = (
    "see that the scheduler runs and all machines have the same versions, and start the study "
    "again: it goes on, and all stored runs are kept"
)
DIED = "died"  # status of a run of which every worker died that had it
WHY_DIED = "each worker that ran it ended by itself (killed, or out of memory)"

ProgressSink = Callable[[int, int], None]  # numbers of done runs, and of those that did not walk


@dataclass(frozen=True)
class Workers:
    """An executor that runs the orders of a job."""

    executor: Executor
    size: Callable[[], int]  # number of workers now, at least 1
    deaths: tuple[type[Exception], ...] = ()  # exceptions of a task whose workers died


@contextmanager
def local_workers(count: int) -> Iterator[Workers]:
    """Runs chunks in worker processes, which have ended when the block ends, or in this process.

    Args:
        count: number of processes. Without any, which suits debuggers, a run that ends its process
            ends the study.
    """
    if count == 0:
        try:
            yield Workers(SerialExecutor(), lambda: 1)
        finally:
            close_runners()
        return
    with TemporaryFolder("workers") as folder, WorkerPool(count, scratch=folder) as pool:
        yield Workers(pool, lambda: count, (WorkerDiedError,))


@contextmanager
def cluster_workers(address: str) -> Iterator[Workers]:
    """Runs chunks on the workers of a Dask scheduler, given its address.

    Dask places the chunks, and moves them from workers that die to others. Raises StudyError when
    no scheduler answers.
    """
    client = _connect(address)
    from distributed import KilledWorker  # noqa: PLC0415  an extra

    def size() -> int:
        try:
            if client.status != "running":
                raise OSError(f"the client is {client.status}")
            return max(len(client.nthreads()), 1)
        except (OSError, RuntimeError, TimeoutError) as error:
            got = f"{type(error).__name__}: {error}"
            raise StudyError("the cluster is gone", got=got, fix=FIX_RESUME) from error

    # its tracebacks of a dead scheduler say no more than our error does
    logging.getLogger("distributed").setLevel(logging.CRITICAL + 1)
    try:
        if not client.nthreads():
            warn(f"the cluster has no workers: waiting for some (dask worker {address})")
        # Dask's executor raises ValueError for a chunk whose worker dies as soon as it has finished
        deaths = KilledWorker, ValueError
        yield Workers(client.get_executor(pure=False), size, deaths)
    finally:
        client.close(timeout=5)


def _connect(address: str) -> Any:
    try:
        from distributed import Client  # noqa: PLC0415  an extra
    except ImportError as error:
        what, expected = "Dask is not installed", "the extra `cluster`"
        fix = install_extra("cluster")
        raise StudyError(what, expected=expected, fix=fix, where="--scheduler") from error
    try:
        if "://" not in address:
            raise ValueError
        return Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        what, expected = "no scheduler answers", "tcp://HOST:8786 of `dask scheduler`"
        raise StudyError(what, got=address, expected=expected, where="--scheduler") from error


@dataclass
class ResultSink:
    """Receives the results of a study: its store and the display of progress."""

    job: Job
    store: Store
    show: ProgressSink
    done: int  # runs that are stored
    failed: int = 0  # new runs that did not walk

    def add(self, results: Sequence[RunResult]) -> None:
        """Stores results."""
        self.store.add(results)
        self.done += len(results)
        self.failed += sum(not result.summary.walked for result in results)
        self.show(self.done, self.failed)


def dispatch(
    sink: ResultSink, workers: Workers, orders: Sequence[Order] | Iterator[Order], count: int
) -> None:
    """Runs orders and stores the results, also when it ends by an exception.

    Orders of chunks in which a worker died are run at the end, each while no other is, so that it
    is known which of them ends its workers.

    Args:
        count: number of orders.

    Raises HexapodError when the disk is full or no worker can go on.
    """
    dispatcher = _Dispatcher(sink, workers)
    try:
        for order in dispatcher.run(iter(orders), count):
            if dispatcher.run(iter([order]), 1):
                died = summary_without_figures(order, WHY_DIED, status=DIED)
                sink.add([RunResult(order, died, 0.0)])
    finally:
        for future in dispatcher.pending:
            future.cancel()
        sink.store.flush()


class _Dispatcher:
    """The state of dispatch()."""

    def __init__(self, sink: ResultSink, workers: Workers) -> None:
        self._sink, self._workers = sink, workers
        self.pending: dict[Future[list[RunResult]], Sequence[Order]] = {}
        self._deaths_in_a_row = 0

    def run(self, orders: Iterator[Order], rest: int) -> list[Order]:
        """Runs a number `rest` of orders in chunks, the last of which are smaller.

        Returns the orders of the chunks in which a worker died.
        """
        suspects: list[Order] = []
        while rest or self.pending:
            slots = CHUNKS_PER_WORKER * self._workers.size()
            while rest and len(self.pending) < slots:
                size = min(max(rest // (2 * slots), 1), MAX_CHUNK)
                chunk = list(islice(orders, size))
                future = self._workers.executor.submit(run_orders, self._sink.job, chunk)
                self.pending[future] = chunk
                rest -= size
            done, _ = wait(self.pending, timeout=CHECK_INTERVAL, return_when=FIRST_COMPLETED)
            for future in done:
                chunk = list(self.pending.pop(future))
                suspects += [] if self._store(future) else chunk
        return suspects

    def _store(self, future: Future[list[RunResult]]) -> bool:
        """Stores the results of a chunk; returns False if its worker died."""
        try:
            results = future.result()
        except self._workers.deaths as error:
            self._deaths_in_a_row += 1
            few, what = self._deaths_in_a_row <= MAX_DEATHS_IN_A_ROW, "each worker dies"
            require(few, str(error), "a worker that goes on", "", what=what, fix=FIX_DEATHS)
            return False
        except StudyError:
            raise
        except Exception as error:  # the scheduler ended, or a worker has not this package
            got, what = f"{type(error).__name__}: {error}", "the workers cannot run the study"
            raise StudyError(what, got=got, fix=FIX_RESUME) from error
        self._deaths_in_a_row = 0
        self._sink.add(results)
        return True
