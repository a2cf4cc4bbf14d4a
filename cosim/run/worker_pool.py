"""Executors for many runs on this machine, with the interface of `concurrent.futures.Executor`.

WorkerPool runs tasks in worker processes, SerialExecutor in the calling process. A study also runs
on the executor of a Dask cluster.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any, TypeVar

from hexapod_cosim.cosim.master.interrupts import blocked_interrupts
from hexapod_cosim.models import HexapodError

START_METHOD = "spawn"  # a fork would copy the locks that threads of this process and numpy hold
TRIES = 3  # processes that may end during a task before it is given up
DIED = "its worker process ended by itself (killed, or out of memory)"

_Result = TypeVar("_Result")

_stop: Event | None = None  # set in worker processes only


class WorkerDiedError(HexapodError):
    """TRIES processes ended while they ran the same task."""


class SerialExecutor(Executor):
    """Runs each task in the calling process, when it is submitted."""

    def submit(
        self, function: Callable[..., _Result], /, *args: Any, **options: Any
    ) -> Future[_Result]:
        """Returns the finished future of the task."""
        future: Future[_Result] = Future()
        try:
            future.set_result(function(*args, **options))
        except Exception as error:
            future.set_exception(error)
        return future


class WorkerPool(Executor):
    """Worker processes, of which each is given one task at a time by a thread of its own.

    So it is known which task a process was running when it died: another process runs it again,
    and after TRIES deaths its future has a WorkerDiedError. Processes start with their first task.

    Args:
        size: number of processes.
        initialise: function that each process calls once, before its first task.
        scratch: folder for temporary files of the processes, which remove it when their parent
            is killed.
    """

    def __init__(
        self,
        size: int,
        *,
        initialise: Callable[[], None] | None = None,
        scratch: Path | None = None,
    ) -> None:
        _refuse_unguarded_script()
        self._context = multiprocessing.get_context(START_METHOD)
        self._stop = self._context.Event()
        self._setup = self._stop, scratch, initialise
        self._threads = ThreadPoolExecutor(size)
        self._own = threading.local()  # the process of each thread
        self._processes: list[ProcessPoolExecutor] = []

    def submit(
        self, function: Callable[..., _Result], /, *args: Any, **options: Any
    ) -> Future[_Result]:
        """Queues a task. A long one calls raise_if_stopped() now and then."""
        return self._threads.submit(self._run, function, args, options)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """Stops the tasks under way, drops the others and waits until all processes have ended."""
        self._stop.set()
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        for process in self._processes:
            process.shutdown(wait)

    def _run(
        self, function: Callable[..., _Result], args: tuple[Any, ...], options: dict[str, Any]
    ) -> _Result:
        """Runs a task in the process of this thread."""
        for _ in range(TRIES):
            try:
                with blocked_interrupts():  # inherited by the process: only `stop` ends its tasks
                    future = self._process().submit(function, *args, **options)
                return future.result()
            except BrokenProcessPool:
                self._own.process.shutdown(wait=False)
                self._own.process = None
        raise WorkerDiedError(
            "a task has no result", got=DIED, fix="look for what ended it, or run fewer at once"
        )

    def _process(self) -> ProcessPoolExecutor:
        process: ProcessPoolExecutor | None = getattr(self._own, "process", None)
        if process is None:
            process = ProcessPoolExecutor(
                1, self._context, initializer=_initialise_worker, initargs=self._setup
            )
            self._own.process = process
            self._processes.append(process)
        return process


def _refuse_unguarded_script() -> None:
    """Raises HexapodError for a script that every worker process would run again from its start."""
    main = sys.modules["__main__"]
    path = Path(getattr(main, "__file__", None) or "")
    is_script = main.__spec__ is None and path.is_file()
    if not is_script or "__name__" in path.read_text(encoding="utf-8", errors="replace"):
        return
    raise HexapodError(
        "worker processes would run the script again",
        got=str(path),
        expected='calls below `if __name__ == "__main__":`',
        fix="write this line above them and indent them, or ask for one worker",
    )


def raise_if_stopped(_done: float) -> None:
    """Raises KeyboardInterrupt when the pool of this worker process is shut down.

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
    threading.Thread(target=_end_with_parent, args=(scratch,), daemon=True).start()
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
