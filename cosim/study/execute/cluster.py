"""Workers of a Dask cluster, which may come, go and die while a study runs. Each gets the job once;
the scheduler sees chunks.

Chunks are handed to workers by name rather than to whichever the scheduler likes. So it is known
what a worker that died was at, the scheduler does not try it again by itself, and a run that ends
its worker costs as many of them as on one machine.
"""

from __future__ import annotations

import logging
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
from hexapod_cosim.cosim.study.execute.cluster_worker import job_plugin, work_here
from hexapod_cosim.cosim.study.execute.crew import IN_FLIGHT, Chunk, Returned
from hexapod_cosim.cosim.study.execute.job import Job
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.models import HexapodError

CONNECT = "10s"  # until a scheduler that does not answer is given up
PATIENCE = 60.0  # s    without any worker, until the study stops
LOOK = (
    1.0  # s    between looks at who is there; the scheduler also tells, but a message may be lost
)
# s    for a chunk's results to travel, until it is looked at whether their worker is still there
FETCH = 5.0
COME_AND_GO = ("add-worker", "remove-worker")
OURS = "hexapod-"  # begins the names of jobs, which their client's ends
DIED = "its worker of the cluster died"
AGAIN = "start the study again when it is back: it goes on, all runs stored so far are kept"


@dataclass(frozen=True)
class _Gone:
    """A worker that is not there any more."""

    address: str
    expected: bool = False  # told to go, rather than ended by what it was at


class Cluster:
    """The workers of a connected client."""

    def __init__(self, client: Any, job: Job, say: EventSink) -> None:
        self._client, self._job, self._say = client, job.name, say
        self._lanes: dict[
            str, deque[Any]
        ] = {}  # by worker, the futures of chunks it was given, in their order
        self._chunks: dict[
            Any, tuple[str, Chunk]
        ] = {}  # by future, its worker and what it was asked for
        self._waiting: deque[Chunk] = deque()
        self._numbers = count()
        self._news: SimpleQueue[Any] = (
            SimpleQueue()
        )  # futures that are done and workers that are gone, from Dask's threads
        self._looked, self._seen, self._missed = -LOOK, monotonic(), False
        client.subscribe_topic("all", self._hear)
        self._look()

    @property
    def size(self) -> int:
        """Workers now; they may become more or fewer. Threads of one would wait for each other."""
        return max(len(self._lanes), 1)

    def hand_in(self, chunk: Chunk) -> None:
        """To the worker with the least to do, as soon as there is one."""
        self._waiting.append(chunk)
        self._hand_out()

    def take(self) -> list[Returned]:
        """Waits until a chunk is back. Raises StudyError when the scheduler is gone, or all
        workers are for too long.
        """
        while True:
            found = [returned for news in self._heard() for returned in self._told(news)]
            self._look()
            self._hand_out()
            if found:
                return found

    def close(self) -> None:
        """Calls back what is still out."""
        self._client.cancel(list(self._chunks))

    def _hear(self, event: Any) -> None:
        """What the scheduler tells everybody, in Dask's thread."""
        _, told = event
        if told.get("action") == "remove-worker":
            self._news.put(_Gone(told["worker"], expected=bool(told.get("expected"))))
        if told.get("action") in COME_AND_GO:
            self._looked = -LOOK  # at once

    def _heard(self) -> list[Any]:
        """All news, after waiting for some."""
        news = []
        with suppress(Empty):
            news.append(self._news.get(timeout=LOOK / 4))
            news.extend(self._news.get_nowait() for _ in range(self._news.qsize()))
        return news

    def _told(self, news: Any) -> list[Returned]:
        return self._without(news) if isinstance(news, _Gone) else self._back(news)

    def _look(self) -> None:
        """Sees who is there, now and then."""
        if monotonic() - self._looked < LOOK:
            return
        self._looked = monotonic()  # first: what is told meanwhile asks for another look
        try:
            if self._client.status != "running":
                raise lost(f"the client is {self._client.status}")
            here = self._client.nthreads()
        except (OSError, RuntimeError) as error:
            raise lost(f"{type(error).__name__}: {error}") from error
        for address in here:
            self._lanes.setdefault(address, deque())
        for address in set(self._lanes) - set(here):
            self._news.put(_Gone(address))
        self._bear_with(bool(here))

    def _bear_with(self, some: bool) -> None:
        """Waits for workers for a while, and says so."""
        now = monotonic()
        if some:
            self._seen, self._missed = now, False
        elif not self._missed:
            self._missed = True
            self._say(f"the cluster has no workers: waiting for some, {PATIENCE:g} s at most")
        elif now - self._seen > PATIENCE:
            raise no_workers(self._client.scheduler.address)

    def _hand_out(self) -> None:
        """Those that may have ended a worker first, each alone on one; while such a one waits
        nothing else is handed out.
        """
        suspects = sorted(self._waiting, key=lambda chunk: not chunk.suspect)
        self._waiting = deque(suspects)
        while self._waiting and self._lanes:
            chunk = self._waiting[0]
            address = min(self._lanes, key=lambda worker: len(self._lanes[worker]))
            lane = self._lanes[address]
            alone = chunk.suspect or any(self._chunks[future][1].suspect for future in lane)
            if len(lane) >= (1 if alone else IN_FLIGHT):
                return
            self._submit(self._waiting.popleft(), address)

    def _submit(self, chunk: Chunk, address: str) -> None:
        key = f"hexapod-{self._job}-{next(self._numbers)}"
        future = self._client.submit(
            work_here, self._job, chunk, key=key, pure=False, workers=[address], retries=0
        )
        self._chunks[future] = address, chunk
        self._lanes[address].append(future)
        future.add_done_callback(self._news.put)

    def _without(self, gone: _Gone) -> list[Returned]:
        """The chunk that a worker ended in; the others it had are handed out again."""
        lane = self._lanes.pop(gone.address, deque())
        left = [(future.status, self._chunks.pop(future)[1]) for future in lane]
        _quietly(self._client.cancel, list(lane))
        guilty = next(
            (chunk for status, chunk in left if status == "pending" and not gone.expected), None
        )
        self._waiting.extendleft(chunk for _, chunk in reversed(left) if chunk is not guilty)
        return [] if guilty is None else [Returned(guilty, [], died=DIED)]

    def _back(self, future: Any) -> list[Returned]:
        """What a future came to; nothing of one that was called back, or whose results are lost
        or late.
        """
        from distributed import KilledWorker  # noqa: PLC0415

        if future not in self._chunks or future.status == "lost":
            return []
        if future.status == "cancelled":
            raise lost("the connection to its scheduler ended")
        died, done = "", []
        try:
            done = future.result(timeout=FETCH)
        except TimeoutError:
            self._news.put(future)
            return []
        except KilledWorker:
            died = DIED
        except HexapodError:
            raise
        except Exception as error:  # of the chunk, or of fetching what it came to
            raise (
                unfit(error)
                if future.status == "error"
                else lost(f"{type(error).__name__}: {error}")
            ) from error
        address, chunk = self._chunks.pop(future)
        self._lanes[address].remove(future)
        future.release()
        return [Returned(chunk, done, died=died)]


def lost(why: str) -> StudyError:
    """The error for a cluster that is gone."""
    return StudyError(
        "the cluster is gone", got=why, expected="a scheduler with workers", fix=AGAIN
    )


def unfit(error: Exception) -> StudyError:
    """The error for a worker on which nothing runs."""
    fix = "install the same versions on all machines of the cluster, with what --engine names"
    return StudyError(
        "a worker of the cluster cannot run the study",
        got=f"{type(error).__name__}: {error}",
        fix=fix,
    )


def no_workers(address: str) -> StudyError:
    """The error for a cluster without any."""
    fix = f"start some: dask worker {address} --nthreads 1; all runs stored so far are kept"
    return StudyError(
        "the cluster has no workers",
        got=f"none for {PATIENCE:g} s",
        expected="one at least",
        fix=fix,
    )


@contextmanager
def cluster_crew(job: Job, address: str, say: EventSink) -> Iterator[Cluster]:
    """The workers behind a scheduler's address. Raises StudyError when there are none."""
    client = _connect(address)
    name = f"{OURS}{client.id}"
    with ExitStack() as opened:
        opened.enter_context(
            _silence("distributed")
        )  # its tracebacks of a scheduler that died: we say what there is to say
        opened.callback(_quietly, client.close, timeout=5)
        _quietly(client.run_on_scheduler, _left_behind())
        opened.callback(_while_there, client, client.unregister_worker_plugin, name)
        try:
            client.register_plugin(job_plugin(job), name=name)
        except Exception as error:  # whatever a worker without the package says
            raise unfit(error) from error
        crew = Cluster(client, job, say)
        opened.callback(_while_there, client, crew.close)
        yield crew


@contextmanager
def _silence(name: str) -> Iterator[None]:
    """Keeps a library's messages off the terminal for a while."""
    log = logging.getLogger(name)
    before = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(before)


def _left_behind() -> Callable[..., Any]:
    """What takes the jobs of studies that were killed off the cluster; a function within, to
    travel by value.
    """
    ours = OURS

    async def clear(dask_scheduler: Any) -> None:
        for name in list(dask_scheduler.worker_plugins):
            if name.startswith(ours) and name.removeprefix(ours) not in dask_scheduler.clients:
                await dask_scheduler.unregister_worker_plugin(comm=None, name=name)

    return clear


def _while_there(client: Any, act: Callable[..., Any], *arguments: Any) -> None:
    """Leaves a scheduler that is gone alone: it would be waited for."""
    if client.status == "running":
        _quietly(act, *arguments)


def _quietly(act: Callable[..., Any], *arguments: Any, **options: Any) -> None:
    with suppress(Exception):
        act(*arguments, **options)


def _connect(address: str) -> Any:
    try:
        from distributed import Client  # noqa: PLC0415  an extra
    except ImportError as error:
        raise StudyError(
            "Dask is not installed", fix=install_extra("cluster"), where="--scheduler"
        ) from error
    try:
        return Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        fix = "start one: dask scheduler; it says its address"
        raise StudyError(
            "no scheduler answers",
            got=address,
            expected="tcp://HOST:8786 of a Dask scheduler",
            fix=fix,
            where="--scheduler",
        ) from error
