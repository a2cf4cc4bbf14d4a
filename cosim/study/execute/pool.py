"""Workers on this machine: processes begun anew, each fed by itself, so that when one dies it is
known on which chunk.
"""

from __future__ import annotations

import multiprocessing
import tempfile
from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path

from hexapod_cosim.cosim.master.interrupts import blocked_interrupts
from hexapod_cosim.cosim.run.workers import METHOD, begin_worker, stop_if_told
from hexapod_cosim.cosim.study.execute.crew import Chunk, Returned
from hexapod_cosim.cosim.study.execute.job import Job
from hexapod_cosim.cosim.study.execute.scratch import job_in, scratch
from hexapod_cosim.cosim.study.execute.worker import close_workshop, work
from hexapod_cosim.cosim.study.store.done import Done

DIED = "its worker process ended by itself (killed, or out of memory)"


class _Lane:
    """One worker process and the chunks it was given, the first of which it is at."""

    def __init__(self, folder: Path, stop: Event) -> None:
        self._folder, self._stop = folder, stop
        self.chunks: deque[tuple[Future[list[Done]], Chunk]] = deque()
        self._begin()

    def _begin(self) -> None:
        context = multiprocessing.get_context(METHOD)
        # the job is read by the process: it would fill the pipe to one that dies before it reads,
        # and be waited for without end
        self._pool = ProcessPoolExecutor(
            1, mp_context=context, initializer=_begin, initargs=(self._stop, self._folder)
        )

    def hand_in(self, chunk: Chunk) -> None:
        try:
            with blocked_interrupts():  # the process, which may begin now
                future = self._pool.submit(_work, chunk)
        except BrokenProcessPool as error:  # it died since; told when what it had is taken
            future = Future()
            future.set_exception(error)
        self.chunks.append((future, chunk))

    def taken(self) -> Iterator[Returned]:
        """What is back."""
        while self.chunks and self.chunks[0][0].done():
            future, chunk = self.chunks.popleft()
            try:
                yield Returned(chunk, future.result())
            except BrokenProcessPool:
                yield from self._dead(chunk)
                return

    def _dead(self, chunk: Chunk) -> Iterator[Returned]:
        """The chunk it was at, and those it had not begun: as if never handed in, for another
        process.
        """
        waiting = [other for _, other in self.chunks]
        self.chunks.clear()
        self._pool.shutdown(wait=False)
        self._begin()
        yield Returned(chunk, [], died=DIED)
        for other in waiting:
            self.hand_in(other)

    def close(self) -> None:
        self._pool.shutdown(wait=True, cancel_futures=True)


class Pool:
    """Worker processes of this machine."""

    def __init__(self, folder: Path, size: int, stop: Event) -> None:
        self.size = size
        self._lanes = [_Lane(folder, stop) for _ in range(size)]

    def hand_in(self, chunk: Chunk) -> None:
        """To the one with the least to do."""
        min(self._lanes, key=lambda lane: len(lane.chunks)).hand_in(chunk)

    def take(self) -> list[Returned]:
        """Waits until a chunk is back."""
        wait(
            [lane.chunks[0][0] for lane in self._lanes if lane.chunks], return_when=FIRST_COMPLETED
        )
        return [returned for lane in self._lanes for returned in lane.taken()]

    def close(self) -> None:
        """Waits for all processes to end."""
        for lane in self._lanes:
            lane.close()


class Here:
    """This process: nothing to start, easy to follow with a debugger, and gone with the first
    walk that ends it.
    """

    size = 1

    def __init__(self, job: Job) -> None:
        self._job, self._chunks = job, deque[Chunk]()

    def hand_in(self, chunk: Chunk) -> None:
        """Keeps it until it is asked for."""
        self._chunks.append(chunk)

    def take(self) -> list[Returned]:
        """Runs a chunk. Raises KeyboardInterrupt when one came within it."""
        chunk = self._chunks.popleft()
        done = work(self._job, chunk.orders, stop_if_told)
        if len(done) < len(chunk.orders):
            raise KeyboardInterrupt
        return [Returned(chunk, done)]


@contextmanager
def own_crew(job: Job) -> Iterator[Here]:
    """This process alone."""
    try:
        yield Here(job)
    finally:
        close_workshop(job.name)


@contextmanager
def local_crew(job: Job, workers: int) -> Iterator[Pool]:
    """Worker processes that are gone when the block ends, however it ends."""
    with scratch(job) as folder:
        stop = multiprocessing.get_context(METHOD).Event()
        pool = Pool(folder, workers, stop)
        try:
            yield pool
        finally:
            stop.set()
            pool.close()


_job: Job | None = None  # of this process, when it is a worker


def _begin(stop: Event, folder: Path) -> None:
    global _job  # noqa: PLW0603  the one thing a worker is told beside its orders
    begin_worker(stop, folder)
    tempfile.tempdir = str(folder)  # so that nothing is left when this process is killed
    _job = job_in(folder)
    multiprocessing.util.Finalize(None, close_workshop, args=(_job.name,), exitpriority=10)


def _work(chunk: Chunk) -> list[Done]:
    assert _job is not None  # _begin came first
    return work(_job, chunk.orders, stop_if_told)
