"""A pool of worker processes on this machine, generic in task and result, and the same interface
within the calling process.

Each worker process has a queue of its own. So it is known which task a worker was running when it
died.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import tempfile
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import connection
from multiprocessing.synchronize import Event
from pathlib import Path
from threading import Thread
from typing import Generic, Protocol, TypeVar

from hexapod_cosim.cosim.master.interrupts import blocked_interrupts

START_METHOD = "spawn"  # a fork would copy the locks that threads of this process and numpy hold
TASKS_PER_WORKER = 2  # a worker that finishes a task has the next one already
DIED = "its worker process ended by itself (killed, or out of memory)"

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

_stop: Event | None = None  # set in worker processes only


@dataclass(frozen=True)
class Finished(Generic[_Task, _Result]):
    """A task that a worker has finished, or of which its worker died."""

    task: _Task
    result: _Result | None  # None when the worker died
    death: str = ""  # how the worker ended; empty when it lives


class TaskExecutor(Protocol[_Task, _Result]):
    """Runs tasks and returns their results in any order."""

    @property
    def size(self) -> int:
        """Number of tasks that run at once."""
        ...

    def submit(self, task: _Task) -> None:
        """Queues a task and returns at once."""
        ...

    def wait(self) -> list[Finished[_Task, _Result]]:
        """Waits until a task is finished. Raises HexapodError when no worker can go on."""
        ...


class InProcessExecutor(Generic[_Task, _Result]):
    """Runs tasks one by one in the calling process, when they are waited for."""

    size = 1

    def __init__(self, run: Callable[[_Task], _Result]) -> None:
        self._run, self._tasks = run, deque[_Task]()

    def submit(self, task: _Task) -> None:
        """Queues a task."""
        self._tasks.append(task)

    def wait(self) -> list[Finished[_Task, _Result]]:
        """Runs the next task. Raises what the task raises."""
        task = self._tasks.popleft()
        return [Finished(task, self._run(task))]


@dataclass(frozen=True)
class _Setup(Generic[_Task, _Result]):
    """What a worker process is started with; all of it is pickled."""

    run: Callable[[_Task], _Result]
    stop: Event
    initialise: Callable[[], None] | None
    scratch: Path | None


class _Worker(Generic[_Task, _Result]):
    """One worker process and the tasks it was given, of which it runs the first."""

    def __init__(self, setup: _Setup[_Task, _Result]) -> None:
        self._setup = setup
        self.queue: deque[tuple[Future[_Result], _Task]] = deque()
        self._start()

    def _start(self) -> None:
        setup = self._setup
        self._process = ProcessPoolExecutor(
            1,
            mp_context=multiprocessing.get_context(START_METHOD),
            initializer=_initialise_worker,
            initargs=(setup.stop, setup.scratch, setup.initialise),
        )

    def submit(self, task: _Task) -> None:
        """Queues a task; the process starts with the first one."""
        try:
            with blocked_interrupts():  # inherited by the process: only `stop` ends its tasks
                future = self._process.submit(self._setup.run, task)
        except BrokenProcessPool as error:  # it died meanwhile; finished() handles the death
            future = Future()
            future.set_exception(error)
        self.queue.append((future, task))

    def finished(self) -> Iterator[Finished[_Task, _Result]]:
        """Removes the finished tasks from the queue."""
        while self.queue and self.queue[0][0].done():
            future, task = self.queue.popleft()
            try:
                yield Finished(task, future.result())
            except BrokenProcessPool:
                yield Finished(task, None, death=DIED)
                self._replace()
                return

    def _replace(self) -> None:
        """Starts another process, which gets the tasks that the dead one had not begun."""
        tasks = [task for _, task in self.queue]
        self.queue.clear()
        self._process.shutdown(wait=False)
        self._start()
        for task in tasks:
            self.submit(task)

    def close(self) -> None:
        """Cancels the queue and waits for the process to end."""
        self._process.shutdown(wait=True, cancel_futures=True)


class WorkerPool(Generic[_Task, _Result]):
    """Worker processes of this machine; see worker_pool()."""

    def __init__(self, size: int, setup: _Setup[_Task, _Result]) -> None:
        self.size = size
        self._workers = [_Worker(setup) for _ in range(size)]

    def submit(self, task: _Task) -> None:
        """Queues a task with the worker that has the shortest queue."""
        min(self._workers, key=lambda worker: len(worker.queue)).submit(task)

    def wait(self) -> list[Finished[_Task, _Result]]:
        """Waits until a task is finished. Raises what the task raises."""
        first = [worker.queue[0][0] for worker in self._workers if worker.queue]
        wait(first, return_when=FIRST_COMPLETED)
        return [item for worker in self._workers for item in worker.finished()]

    def close(self) -> None:
        """Waits for all processes to end."""
        for worker in self._workers:
            worker.close()


@contextmanager
def worker_pool(
    size: int,
    run: Callable[[_Task], _Result],
    *,
    initialise: Callable[[], None] | None = None,
    scratch: Path | None = None,
) -> Iterator[WorkerPool[_Task, _Result]]:
    """Opens a pool whose processes have ended when the block ends, however it ends.

    Args:
        size: number of processes, which start with their first task.
        run: function of a module that a process runs for each task; long ones call
            raise_if_stopped() now and then.
        initialise: function that each process calls once, before its first task.
        scratch: folder for temporary files of the processes, which remove it when their parent
            is killed.
    """
    stop = multiprocessing.get_context(START_METHOD).Event()
    pool = WorkerPool(size, _Setup(run, stop, initialise, scratch))
    try:
        yield pool
    finally:
        stop.set()
        pool.close()


def raise_if_stopped(_done: float) -> None:
    """Raises KeyboardInterrupt when the pool of this worker process is closing.

    Its argument is that of a Progress callback, as which it is passed to the master.
    """
    if _stop is not None and _stop.is_set():
        raise KeyboardInterrupt


def processor_count() -> int:
    """Returns the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _initialise_worker(
    stop: Event, scratch: Path | None, initialise: Callable[[], None] | None
) -> None:
    """Makes this process a worker, which ends when its parent is gone."""
    global _stop  # noqa: PLW0603  a worker process belongs to one pool
    # imported here: commands without workers start sooner
    from threadpoolctl import threadpool_limits  # noqa: PLC0415

    _stop = stop
    threadpool_limits(1)  # there is a worker for each processor
    Thread(target=_end_with_parent, args=(scratch,), daemon=True).start()
    if scratch is not None:
        tempfile.tempdir = str(scratch)
    if initialise is not None:
        initialise()


def _end_with_parent(scratch: Path | None) -> None:
    """Ends this process when its parent is gone: it would wait for tasks without end."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)
        os._exit(1)
