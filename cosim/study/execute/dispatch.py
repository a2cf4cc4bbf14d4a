"""Dispatches the runs of a study in chunks to an executor and stores the results.

Memory does not grow with the number of runs, except for a byte for each that marks it as done:
orders are made when a worker has room for them, and rows are written to the disk in parts. The
result of a run depends on its order alone. So the results depend neither on the workers, nor on
the chunks, nor on how often the study was killed and started again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.run.worker_pool import TASKS_PER_WORKER
from hexapod_cosim.cosim.study.execute.chunk import (
    MAX_DEATHS,
    Chunk,
    ChunkExecutor,
    FinishedChunk,
)
from hexapod_cosim.cosim.study.execute.worker import summary_without_figures
from hexapod_cosim.cosim.study.plan.records import Order, Study, StudyError
from hexapod_cosim.cosim.study.store.columns import row_of
from hexapod_cosim.cosim.study.store.run_result import RunResult
from hexapod_cosim.cosim.study.store.store import Store

# s    of work in a chunk: the cost of sending it is small beside that, and a dead worker loses
# little
CHUNK_TIME = 0.5
MAX_CHUNK_RATE = 40.0  # 1/s  chunks from all workers: a cluster's scheduler needs ms for each
MAX_CHUNK = 256  # runs
MAX_DEATHS_IN_A_ROW = 3 * MAX_DEATHS  # for each worker: more are not caused by single runs
FIX_DEATHS = (
    "look for what ends them (memory?); a script that runs a study needs "
    '`if __name__ == "__main__":`'
)
DIED = "died"  # status of a run of which every worker died that had it

ProgressSink = Callable[[int, int], None]  # numbers of new runs, and of those that did not walk


@dataclass(frozen=True)
class ResultSink:
    """Receives the results of a study: its store and the display of progress."""

    study: Study
    store: Store
    progress: ProgressSink


class _ChunkSize:
    """Number of runs in a chunk, from the mean time of the runs so far."""

    def __init__(self) -> None:
        self._runs, self._time = 0, 0.0

    def add(self, results: Iterable[RunResult]) -> None:
        for result in results:
            self._runs, self._time = self._runs + 1, self._time + result.wall

    def value(self, workers: int) -> int:
        if not self._runs:
            return 1
        size = chunk_time(workers) * self._runs / max(self._time, 1e-9)
        return int(min(max(size, 1), MAX_CHUNK))


def chunk_time(workers: int) -> float:
    """Returns the duration of the runs of a chunk [s] for a number of workers."""
    return max(CHUNK_TIME, workers / MAX_CHUNK_RATE)


def dispatch(
    sink: ResultSink, executor: ChunkExecutor, orders: Iterable[Order]
) -> Generator[list[RunResult], None, None]:
    """Runs orders, stores the results and yields them.

    All results are stored when the iterator is closed. Raises HexapodError when the disk is full
    or no worker is left.
    """
    return _Dispatcher(sink, executor, orders).results()


class _Dispatcher:
    """The state of dispatch()."""

    def __init__(self, sink: ResultSink, executor: ChunkExecutor, orders: Iterable[Order]) -> None:
        self._sink, self._executor = sink, executor
        self._orders = iter(orders)
        self._retries: deque[Chunk] = deque()
        self._size = _ChunkSize()
        self._submitted = 0  # chunks that the executor has
        self._deaths_in_a_row = 0

    def results(self) -> Generator[list[RunResult], None, None]:
        try:
            while True:
                self._submit()
                if not self._submitted:
                    return
                for finished in self._executor.wait():
                    self._submitted -= 1
                    yield self._store(finished)
        finally:
            self._sink.store.flush()

    def _submit(self) -> None:
        """Fills the queues of the executor."""
        while self._submitted < TASKS_PER_WORKER * self._executor.size:
            chunk = self._next_chunk()
            if chunk is None:
                return
            self._executor.submit(chunk)
            self._submitted += 1

    def _next_chunk(self) -> Chunk | None:
        if self._retries:
            return self._retries.popleft()
        orders = tuple(islice(self._orders, self._size.value(self._executor.size)))
        return Chunk(orders) if orders else None

    def _store(self, finished: FinishedChunk) -> list[RunResult]:
        """Stores the results of a chunk and queues the orders that were not run."""
        sink, found = self._sink, finished.result or []
        self._check_deaths(finished)
        results = [*found, *_given_up(finished)]
        self._retries.extend(_retries(finished, len(results)))
        self._size.add(found)
        sink.store.add(row_of(result, sink.study) for result in results)
        sink.progress(len(results), sum(not result.summary.walked for result in results))
        return results

    def _check_deaths(self, finished: FinishedChunk) -> None:
        """Raises StudyError when workers only die."""
        if finished.result:
            self._deaths_in_a_row = 0
        else:
            self._deaths_in_a_row += bool(finished.death)
        if self._deaths_in_a_row > MAX_DEATHS_IN_A_ROW * self._executor.size:
            raise StudyError(
                "every worker dies before it has finished a run",
                got=finished.death,
                fix=FIX_DEATHS,
                where=self._sink.study.where,
            )


def _given_up(finished: FinishedChunk) -> list[RunResult]:
    """Returns the result of a single order of which MAX_DEATHS workers died."""
    chunk = finished.task
    if not finished.death or len(chunk.orders) > 1 or chunk.deaths + 1 < MAX_DEATHS:
        return []
    (order,) = chunk.orders
    reason = f"{finished.death}, {MAX_DEATHS} times"
    return [RunResult(order, summary_without_figures(order, reason, status=DIED), 0.0)]


def _retries(finished: FinishedChunk, done: int) -> list[Chunk]:
    """Returns chunks of the orders that were not run: single ones when the worker died."""
    chunk = finished.task
    rest = replace(chunk, orders=chunk.orders[done:])
    if not rest.orders:
        return []
    return rest.split() if finished.death else [rest]


def missing_runs(done: NDArray[np.bool_]) -> Iterator[int]:
    """Yields the numbers of the runs that are not marked in `done` (count,)."""
    block = 65_536
    for begin in range(0, len(done), block):
        yield from (begin + np.flatnonzero(~done[begin : begin + block])).tolist()
