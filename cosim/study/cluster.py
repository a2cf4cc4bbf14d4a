"""Workers of a Dask cluster, which may come, go and die while a study runs. Each gets the job once; the scheduler sees chunks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from typing import Any

from hexapod_cosim.cosim.study.crew import Chunk, Returned
from hexapod_cosim.cosim.study.job import Job
from hexapod_cosim.cosim.study.records import StudyError
from hexapod_cosim.cosim.study.worker import Done, close_workshop, work
from hexapod_cosim.models import HexapodError

CONNECT = "10s"  # until a scheduler that does not answer is given up
PATIENCE = 60  # s    without any worker, until the study stops
DIED = "its worker of the cluster died"
AGAIN = "start the study again when it is back: it goes on, all runs stored so far are kept"


class Cluster:
    """The workers of a connected client."""

    def __init__(self, client: Any, job: Job) -> None:
        from distributed import as_completed  # noqa: PLC0415  an extra

        self._client, self._hash = client, job.hash
        self._chunks: dict[Any, Chunk] = {}
        self._numbers = count()
        self._back = as_completed([], loop=client.loop)

    @property
    def size(self) -> int:
        """Threads of all workers now; they may become more or fewer."""
        return max(sum(map(int, self._client.nthreads().values())), 1)

    def hand_in(self, chunk: Chunk) -> None:
        """To the scheduler."""
        key = f"hexapod-{self._hash[:12]}-{chunk.orders[0].run}-{next(self._numbers)}"
        future = self._client.submit(work_here, self._hash, chunk, key=key, pure=False)
        self._chunks[future] = chunk
        self._back.add(future)

    def take(self) -> list[Returned]:
        """Waits until a chunk is back. Raises StudyError when the scheduler or all workers are gone."""
        try:
            future = self._back.next_batch(block=True)
        except (OSError, RuntimeError) as error:
            raise lost(error) from error
        return [self._returned(item) for item in future]

    def _returned(self, future: Any) -> Returned:
        from distributed import KilledWorker  # noqa: PLC0415

        chunk = self._chunks.pop(future)
        try:
            return Returned(chunk, future.result())
        except KilledWorker:
            return Returned(chunk, [], died=DIED)
        except HexapodError:
            raise
        except Exception as error:  # cancelled: the connection is gone; else what the worker raised
            raise lost(error) from error
        finally:
            with suppress(Exception):
                future.release()


def lost(error: Exception) -> StudyError:
    """The error for a cluster that is gone."""
    return StudyError("the cluster is gone", got=f"{type(error).__name__}: {error}", expected="a scheduler with workers", fix=AGAIN)


@contextmanager
def cluster_crew(job: Job, address: str) -> Iterator[Cluster]:
    """The workers behind a scheduler's address. Raises StudyError when there are none."""
    client, name = _connect(address), f"hexapod-{job.hash}"
    try:
        client.register_plugin(_plugin(job), name=name)
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError as error:
            fix = f"start some: dask worker {address} --nthreads 1"
            raise StudyError("the cluster has no workers", got=address, expected="one at least", fix=fix) from error
        yield Cluster(client, job)
    finally:
        with suppress(Exception):
            client.unregister_worker_plugin(name)
        with suppress(Exception):
            client.close(timeout=5)


def _connect(address: str) -> Any:
    try:
        from distributed import Client  # noqa: PLC0415  an extra
    except ImportError as error:
        raise StudyError("Dask is not installed", fix="pip install 'hexapod-cosim[cluster]'", where="--scheduler") from error
    try:
        return Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        fix = "start one: dask scheduler; it says its address"
        raise StudyError(
            "no scheduler answers", got=address, expected="tcp://HOST:8786 of a Dask scheduler", fix=fix, where="--scheduler"
        ) from error


def _plugin(job: Job) -> Any:
    """What puts the job on every worker, those too that come later or begin anew."""
    from distributed import WorkerPlugin  # noqa: PLC0415  an extra

    class JobPlugin(WorkerPlugin):  # type: ignore[misc]  # untyped
        def setup(self, worker: Any) -> None:
            take_job(job)

        def teardown(self, worker: Any) -> None:
            drop_job(job.hash)

    return JobPlugin()


_jobs: dict[str, Job] = {}  # of this process, when it is a worker


def take_job(job: Job) -> None:
    """On a worker, before its first chunk: a function of its own, since the plugin travels by value and would bring its own `_jobs`."""
    _jobs[job.hash] = job


def drop_job(job: str) -> None:
    """On a worker that has done with a job."""
    close_workshop()
    _jobs.pop(job, None)


def work_here(job: str, chunk: Chunk) -> list[Done]:
    """Runs a chunk on a worker that has the job."""
    return work(_jobs[job], chunk.orders, lambda _done: None)
