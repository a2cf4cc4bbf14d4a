"""Dispatches the runs of a study in chunks to an executor and stores the results.

Orders are made when a worker has room for them, and rows are written to the disk in parts, so
memory does not grow with the number of runs, except for a byte for each that marks it as done. The
result of a run depends on its order alone, and so neither on the workers nor on the chunks nor on
how often the study was killed.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.study.records import Order, RunResult, Study, StudyError
from hexapod_cosim.extensions.study.store import Store
from hexapod_cosim.extensions.study.worker import run_orders, summary_without_figures
from hexapod_cosim.extensions.study.workers import FIX_RESUME, Workers, unfit_worker

# s    of work in a chunk: the cost of sending it is small beside that, and a dead worker loses
# little
CHUNK_TIME = 0.5
MAX_CHUNK_RATE = 40.0  # 1/s  chunks from all workers: a cluster's scheduler needs ms for each
MAX_CHUNK = 256  # runs
CHUNKS_PER_WORKER = 2  # a worker that finishes a chunk has the next one already
CHECK_INTERVAL = 0.5  # s    between checks for interrupts and for workers
MAX_DEATHS_IN_A_ROW = 10  # chunks: more are not caused by single runs
FIX_DEATHS = (
    "look for what ends them (memory?); a script that runs a study needs "
    '`if __name__ == "__main__":`'
)
DIED = "died"  # status of a run of which every worker died that had it
WHY_DIED = "each worker that ran it ended by itself (killed, or out of memory)"

ProgressSink = Callable[[int, int], None]  # numbers of new runs, and of those that did not walk
_Chunk = tuple[Order, ...]


@dataclass(frozen=True)
class ResultSink:
    """Receives the results of a study: its store and the display of progress."""

    study: Study
    store: Store
    progress: ProgressSink

    def add(self, results: list[RunResult]) -> None:
        """Stores results."""
        self.store.add(results)
        self.progress(len(results), sum(not result.summary.walked for result in results))


def dispatch(sink: ResultSink, workers: Workers, orders: Iterable[Order]) -> None:
    """Runs orders and stores the results, also when it ends by an exception.

    Raises HexapodError when the disk is full or no worker can go on.
    """
    dispatcher = _Dispatcher(sink, workers, orders)
    try:
        while dispatcher.submit():
            dispatcher.collect()
    finally:
        dispatcher.cancel()
        sink.store.flush()


class _Dispatcher:
    """The state of dispatch()."""

    def __init__(self, sink: ResultSink, workers: Workers, orders: Iterable[Order]) -> None:
        self._sink, self._workers, self._orders = sink, workers, iter(orders)
        self._pending: dict[Future[list[RunResult]], _Chunk] = {}
        # orders of chunks in which a worker died: each is run while no other chunk is, so that
        # the cause of another death is known
        self._suspects: deque[Order] = deque()
        self._alone = False  # whether a suspect is running
        self._deaths_in_a_row = 0
        self._runs, self._time = 0, 0.0  # of all results: number and elapsed time [s]

    def submit(self) -> bool:
        """Fills the queue of the executor; returns whether it holds any chunk."""
        if self._alone and self._pending:
            return True
        self._alone = bool(self._suspects) and not self._pending
        if self._alone:
            self._submit((self._suspects.popleft(),))
        if self._suspects or self._alone:
            return True
        size = self._workers.size()
        while len(self._pending) < CHUNKS_PER_WORKER * size:
            chunk = tuple(islice(self._orders, self._chunk_size(size)))
            if not chunk:
                break
            self._submit(chunk)
        return bool(self._pending)

    def _submit(self, chunk: _Chunk) -> None:
        future = self._workers.executor.submit(run_orders, self._workers.job, chunk)
        self._pending[future] = chunk

    def _chunk_size(self, workers: int) -> int:
        """Returns the number of runs in a chunk, from the mean time of the runs so far."""
        if not self._runs:
            return 1
        size = chunk_time(workers) * self._runs / max(self._time, 1e-9)
        return int(min(max(size, 1), MAX_CHUNK))

    def collect(self) -> None:
        """Waits until a chunk is finished, or for a while, and stores the results."""
        done, _ = wait(self._pending, timeout=CHECK_INTERVAL, return_when=FIRST_COMPLETED)
        self._workers.check()
        for future in done:
            chunk = self._pending.pop(future)
            results = self._results(future, chunk)
            self._runs += len(results)
            self._time += sum(result.wall for result in results)
            self._sink.add(results)

    def _results(self, future: Future[list[RunResult]], chunk: _Chunk) -> list[RunResult]:
        """Returns the results of a chunk; none of one in which a worker died."""
        try:
            results = future.result()
        except self._workers.deaths as error:
            return self._after_death(chunk, error)
        except StudyError:
            raise
        except CancelledError as error:
            raise StudyError(
                "the cluster is gone",
                got="the connection to its scheduler ended",
                fix=FIX_RESUME,
            ) from error
        except Exception as error:  # from a worker without the package, or with another one
            raise unfit_worker(error) from error
        self._deaths_in_a_row = 0
        return results

    def _after_death(self, chunk: _Chunk, error: Exception) -> list[RunResult]:
        """Returns the result of an order that ends its workers; of other chunks none, yet."""
        self._deaths_in_a_row += 1
        if self._deaths_in_a_row > MAX_DEATHS_IN_A_ROW:
            raise StudyError(
                "every worker dies before it has finished a run",
                got=str(error),
                fix=FIX_DEATHS,
                where=self._sink.study.where,
            ) from error
        if not self._alone:
            self._suspects.extend(chunk)
            return []
        (order,) = chunk
        return [RunResult(order, summary_without_figures(order, WHY_DIED, status=DIED), 0.0)]

    def cancel(self) -> None:
        """Cancels the chunks that are not finished."""
        for future in self._pending:
            future.cancel()


def chunk_time(workers: int) -> float:
    """Returns the duration of the runs of a chunk [s] for a number of workers."""
    return max(CHUNK_TIME, workers / MAX_CHUNK_RATE)


def missing_runs(done: NDArray[np.bool_]) -> Iterator[int]:
    """Yields the numbers of the runs that are not marked in `done` (count,)."""
    block = 65_536
    for begin in range(0, len(done), block):
        yield from (begin + np.flatnonzero(~done[begin : begin + block])).tolist()
