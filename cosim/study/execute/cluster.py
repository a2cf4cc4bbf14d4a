"""Executes the chunks of a study on the workers of a Dask cluster, which may join, leave and die.

Chunks are assigned to workers by name; Dask's scheduler does not choose. So it is known which
chunk a dead worker was running, the scheduler does not retry it by itself, and a run that ends
its worker costs as many workers as on one machine.
"""

from __future__ import annotations

import logging
import re
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any

from hexapod_cosim.cosim.common.events import EventSink
from hexapod_cosim.cosim.common.installation import install_extra
from hexapod_cosim.cosim.master.interrupts import remembered_interrupts
from hexapod_cosim.cosim.run.worker_pool import TASKS_PER_WORKER, Finished
from hexapod_cosim.cosim.study.execute.chunk import Chunk, FinishedChunk
from hexapod_cosim.cosim.study.execute.cluster_worker import job_plugin, run_chunk
from hexapod_cosim.cosim.study.execute.job import Job
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.models import HexapodError

CONNECT_TIMEOUT = "10s"
ADDRESS = re.compile(r"[a-z]+://\S+")  # PROTOCOL://HOST:PORT, as Dask writes it
NO_WORKER_TIMEOUT = 60.0  # s    without any worker, after which the study stops
# s    between requests for the list of workers: the scheduler announces changes as well, but a
# message may be lost
CHECK_INTERVAL = 1.0
FETCH_TIMEOUT = 5.0  # s    for the transfer of a chunk's results, before the worker is checked
WORKER_EVENTS = ("add-worker", "remove-worker")
JOB_PREFIX = "hexapod-"  # of the names of jobs, followed by their client's
DIED = "its worker of the cluster died"
FIX_RESUME = "start the study again when it is back; it continues, and all stored runs are kept"


@dataclass(frozen=True)
class _RemovedWorker:
    """The event that a worker has left the cluster."""

    address: str
    expected: bool = False  # whether it was requested to leave


class ClusterExecutor:
    """Runs chunks on the workers that a connected client sees.

    `check_interrupts` raises KeyboardInterrupt if one has arrived; waiting calls it.
    """

    def __init__(
        self, client: Any, job: Job, events: EventSink, check_interrupts: Callable[[], None]
    ) -> None:
        self._client, self._job, self._event_sink = client, job.name, events
        self._check_interrupts = check_interrupts
        # by worker, the futures of its chunks in the order of their submission
        self._queues: dict[str, deque[Any]] = {}
        # by future, its worker and chunk
        self._chunks: dict[Any, tuple[str, Chunk]] = {}
        self._waiting: deque[Chunk] = deque()  # chunks without a worker
        self._numbers = count()
        # finished futures and removed workers, from Dask's threads
        self._events: SimpleQueue[Any] = SimpleQueue()
        self._last_check = -CHECK_INTERVAL  # s
        self._last_worker = monotonic()  # s    when there was a worker
        self._warned = False  # that there are no workers
        client.subscribe_topic("all", self._on_scheduler_event)
        self._check_workers()

    @property
    def size(self) -> int:
        """Number of workers now, at least 1. A worker runs one chunk, whatever its threads."""
        return max(len(self._queues), 1)

    def submit(self, chunk: Chunk) -> None:
        """Queues a chunk for the worker with the shortest queue, when there is a worker."""
        self._waiting.append(chunk)
        self._assign()

    def wait(self) -> list[FinishedChunk]:
        """Waits until a chunk is finished.

        Raises StudyError when the scheduler is gone, or all workers are for too long.
        """
        while True:
            self._check_interrupts()
            finished = [item for event in self._next_events() for item in self._handle(event)]
            self._check_workers()
            self._assign()
            if finished:
                return finished

    def close(self) -> None:
        """Cancels the chunks that are not finished."""
        self._client.cancel(list(self._chunks))

    def _on_scheduler_event(self, event: Any) -> None:
        """Receives a message of the scheduler, in Dask's thread."""
        _, message = event
        if message.get("action") == "remove-worker":
            expected = bool(message.get("expected"))
            self._events.put(_RemovedWorker(message["worker"], expected=expected))
        if message.get("action") in WORKER_EVENTS:
            self._last_check = -CHECK_INTERVAL  # the next check is due

    def _next_events(self) -> list[Any]:
        """Waits for an event, for a while, and returns all that there are."""
        events = []
        with suppress(Empty):
            events.append(self._events.get(timeout=CHECK_INTERVAL / 4))
            events.extend(self._events.get_nowait() for _ in range(self._events.qsize()))
        return events

    def _handle(self, event: Any) -> list[FinishedChunk]:
        return self._removed(event) if isinstance(event, _RemovedWorker) else self._done(event)

    def _check_workers(self) -> None:
        """Compares the queues with the workers of the cluster, when a check is due."""
        if monotonic() - self._last_check < CHECK_INTERVAL:
            return
        self._last_check = monotonic()  # first: an event meanwhile makes another check due
        try:
            if self._client.status != "running":
                raise cluster_lost(f"the client is {self._client.status}")
            workers = self._client.nthreads()
        except (OSError, RuntimeError) as error:
            raise cluster_lost(f"{type(error).__name__}: {error}") from error
        for address in workers:
            self._queues.setdefault(address, deque())
        for address in set(self._queues) - set(workers):
            self._events.put(_RemovedWorker(address))
        self._check_timeout(bool(workers))

    def _check_timeout(self, any_worker: bool) -> None:
        """Warns that there are no workers, and raises StudyError after NO_WORKER_TIMEOUT."""
        now = monotonic()
        if any_worker:
            self._last_worker, self._warned = now, False
        elif not self._warned:
            self._warned = True
            self._event_sink(
                f"the cluster has no workers: waiting for some, {NO_WORKER_TIMEOUT:g} s at most"
            )
        elif now - self._last_worker > NO_WORKER_TIMEOUT:
            raise no_workers(self._client.scheduler.address)

    def _assign(self) -> None:
        """Submits waiting chunks to workers, suspect ones first.

        A suspect chunk is alone on its worker, and while one waits no other chunk is submitted.
        """
        self._waiting = deque(sorted(self._waiting, key=lambda chunk: not chunk.suspect))
        while self._waiting and self._queues:
            chunk = self._waiting[0]
            address = min(self._queues, key=lambda worker: len(self._queues[worker]))
            queue = self._queues[address]
            alone = chunk.suspect or any(self._chunks[future][1].suspect for future in queue)
            if len(queue) >= (1 if alone else TASKS_PER_WORKER):
                return
            self._submit_to(address, self._waiting.popleft())

    def _submit_to(self, address: str, chunk: Chunk) -> None:
        key = f"hexapod-{self._job}-{next(self._numbers)}"
        future = self._client.submit(
            run_chunk, self._job, chunk, key=key, pure=False, workers=[address], retries=0
        )
        self._chunks[future] = address, chunk
        self._queues[address].append(future)
        future.add_done_callback(self._events.put)

    def _removed(self, worker: _RemovedWorker) -> list[FinishedChunk]:
        """Returns the chunk in which a worker ended; its other chunks wait for a worker again."""
        queue = self._queues.pop(worker.address, deque())
        left = [(future.status, self._chunks.pop(future)[1]) for future in queue]
        _suppress_errors(self._client.cancel, list(queue))
        running = (chunk for status, chunk in left if status == "pending")
        cause = None if worker.expected else next(running, None)
        self._waiting.extendleft(chunk for _, chunk in reversed(left) if chunk is not cause)
        return [] if cause is None else [Finished(cause, None, death=DIED)]

    def _done(self, future: Any) -> list[FinishedChunk]:
        """Returns the chunk of a future with its results.

        Returns nothing for a future that was cancelled by us, or whose results are lost or late.
        """
        from distributed import KilledWorker  # noqa: PLC0415

        if future not in self._chunks or future.status == "lost":
            return []
        if future.status == "cancelled":
            raise cluster_lost("the connection to its scheduler ended")
        death, results = "", None
        try:
            results = future.result(timeout=FETCH_TIMEOUT)
        except TimeoutError:
            self._events.put(future)
            return []
        except KilledWorker:
            death = DIED
        except HexapodError:
            raise
        except Exception as error:  # of the chunk, or of the transfer of its results
            if future.status == "error":
                raise unfit_worker(error) from error
            raise cluster_lost(f"{type(error).__name__}: {error}") from error
        address, chunk = self._chunks.pop(future)
        self._queues[address].remove(future)
        future.release()
        return [Finished(chunk, results, death=death)]


def cluster_lost(reason: str) -> StudyError:
    """Returns the error for a cluster that cannot be reached any more."""
    return StudyError(
        "the cluster is gone", got=reason, expected="a scheduler with workers", fix=FIX_RESUME
    )


def unfit_worker(error: Exception) -> StudyError:
    """Returns the error for a worker that can run no chunk."""
    fix = "install the same versions on all machines of the cluster, with what --engine names"
    return StudyError(
        "a worker of the cluster cannot run the study",
        got=f"{type(error).__name__}: {error}",
        fix=fix,
    )


def no_workers(address: str) -> StudyError:
    """Returns the error for a cluster without workers, given its scheduler's address."""
    fix = f"start some: dask worker {address} --nthreads 1; all runs stored so far are kept"
    return StudyError(
        "the cluster has no workers",
        got=f"none for {NO_WORKER_TIMEOUT:g} s",
        expected="one at least",
        fix=fix,
    )


@contextmanager
def cluster_executor(job: Job, address: str, events: EventSink) -> Iterator[ClusterExecutor]:
    """Runs chunks on the cluster of a scheduler, given its address.

    Raises StudyError when no scheduler answers or a worker cannot run the study.
    """
    client = _connect(address)
    name = f"{JOB_PREFIX}{client.id}"
    with ExitStack() as opened:
        # its tracebacks of a dead scheduler say no more than our error does
        opened.enter_context(_silenced("distributed"))
        opened.callback(_suppress_errors, client.close, timeout=5)
        _suppress_errors(client.run_on_scheduler, _remove_stale_jobs())
        opened.callback(_while_running, client, client.unregister_worker_plugin, name)
        try:
            client.register_plugin(job_plugin(job), name=name)
        except Exception as error:  # of any kind, from a worker without the package
            raise unfit_worker(error) from error
        check_interrupts = opened.enter_context(remembered_interrupts())
        executor = ClusterExecutor(client, job, events, check_interrupts)
        opened.callback(_while_running, client, executor.close)
        yield executor


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


def _remove_stale_jobs() -> Callable[..., Any]:
    """Returns a function for the scheduler that removes the jobs of programs that were killed.

    The function is a local one, because it must be sent by value.
    """
    prefix = JOB_PREFIX

    async def remove(dask_scheduler: Any) -> None:
        for name in list(dask_scheduler.worker_plugins):
            if name.startswith(prefix) and name.removeprefix(prefix) not in dask_scheduler.clients:
                await dask_scheduler.unregister_worker_plugin(comm=None, name=name)

    return remove


def _while_running(client: Any, act: Callable[..., Any], *arguments: Any) -> None:
    """Calls a function unless the scheduler is gone: the call would wait for it."""
    if client.status == "running":
        _suppress_errors(act, *arguments)


def _suppress_errors(act: Callable[..., Any], *arguments: Any, **options: Any) -> None:
    with suppress(Exception):
        act(*arguments, **options)


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
