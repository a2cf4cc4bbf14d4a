"""Dispatches the runs of a study in chunks to an executor and stores the results.

Orders are made when a worker has room for them, and rows are written to the disk in parts, so
memory does not grow with the number of runs, except for a byte for each that marks it as done. The
result of a run depends on its order alone, and so neither on the workers nor on the chunks nor on
how often the study was killed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass
from itertools import islice

from hexapod_cosim.extensions.study.records import Order, RunResult, Study, StudyError
from hexapod_cosim.extensions.study.store import Store
from hexapod_cosim.extensions.study.worker import run_orders, summary_without_figures
from hexapod_cosim.extensions.study.workers import FIX_RESUME, Workers

MAX_CHUNK = 16  # runs: half a second of work, so that a dead worker loses little
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
_Chunk = Sequence[Order]


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
        dispatcher.run(iter(orders), count)
        for order in dispatcher.suspects:
            dispatcher.run_alone(order)
    finally:
        dispatcher.cancel()
        sink.store.flush()


class _Dispatcher:
    """The state of dispatch()."""

    def __init__(self, sink: ResultSink, workers: Workers) -> None:
        self._sink, self._workers = sink, workers
        self._pending: dict[Future[list[RunResult]], _Chunk] = {}
        self._deaths_in_a_row = 0
        self.suspects: list[Order] = []  # of chunks in which a worker died

    def run(self, orders: Iterator[Order], rest: int) -> None:
        """Runs a number `rest` of orders in chunks, the last of which are smaller."""
        while rest or self._pending:
            slots = CHUNKS_PER_WORKER * self._workers.size()
            while rest and len(self._pending) < slots:
                size = min(max(rest // (2 * slots), 1), MAX_CHUNK)
                self._submit(tuple(islice(orders, size)))
                rest -= size
            for chunk, results in self._finished():
                self.suspects += chunk if results is None else ()
                self._sink.add(results or [])

    def run_alone(self, order: Order) -> None:
        """Runs an order while no other one is; a worker that dies is its failure."""
        self._submit((order,))
        while self._pending:
            self._workers.size()  # raises an error when there are none
            for _, results in self._finished():
                died = summary_without_figures(order, WHY_DIED, status=DIED)
                self._sink.add([RunResult(order, died, 0.0)] if results is None else results)

    def _submit(self, chunk: _Chunk) -> None:
        future = self._workers.executor.submit(run_orders, self._workers.job, chunk)
        self._pending[future] = chunk

    def _finished(self) -> Iterator[tuple[_Chunk, list[RunResult] | None]]:
        """Waits until a chunk is finished, or for a while.

        Yields the finished chunks with their results, None where a worker died.
        """
        done, _ = wait(self._pending, timeout=CHECK_INTERVAL, return_when=FIRST_COMPLETED)
        self._workers.check()
        for future in done:
            yield self._pending.pop(future), self._results(future)

    def _results(self, future: Future[list[RunResult]]) -> list[RunResult] | None:
        """Returns the results of a chunk; None for one in which a worker died."""
        try:
            results = future.result()
        except self._workers.deaths as error:
            self._deaths_in_a_row += 1
            if self._deaths_in_a_row > MAX_DEATHS_IN_A_ROW:
                what = "every worker dies before it has finished a run"
                where = self._sink.study.where
                raise StudyError(what, got=str(error), fix=FIX_DEATHS, where=where) from error
            return None
        except StudyError:
            raise
        except CancelledError as error:
            got = "the connection to its scheduler ended"
            raise StudyError("the cluster is gone", got=got, fix=FIX_RESUME) from error
        except Exception as error:  # from a worker without the package, or with another one
            raise StudyError(
                "a worker cannot run the study",
                got=f"{type(error).__name__}: {error}",
                fix="install the same versions on all machines of the cluster",
            ) from error
        self._deaths_in_a_row = 0
        return results

    def cancel(self) -> None:
        """Cancels the chunks that are not finished."""
        for future in self._pending:
            future.cancel()
