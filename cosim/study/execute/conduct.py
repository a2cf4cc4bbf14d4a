"""The loop around a study's runs: hands out chunks, keeps what comes back, goes on where it was.

Memory does not grow with the number of runs, but for a byte each that says which are done: orders
are made when a worker has room for them, rows leave for the disk in parts. What a run comes to
depends on its order alone, so neither the workers, nor the chunks, nor how often a study was killed
show in the result.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.study.execute.crew import DEATHS, IN_FLIGHT, Chunk, Crew, Returned
from hexapod_cosim.cosim.study.execute.worker import failed
from hexapod_cosim.cosim.study.plan.records import Order, Study, StudyError
from hexapod_cosim.cosim.study.store.columns import row_of
from hexapod_cosim.cosim.study.store.done import Done
from hexapod_cosim.cosim.study.store.store import Store

# s    of work in a chunk: what a hand-over costs is small beside it, and little is lost with a
# worker
CHUNK_TIME = 0.5
# 1/s    that come back from all workers together: a cluster's scheduler takes some milliseconds for
# each
MOST_CHUNKS = 40.0
MAX_CHUNK = 256
USELESS = (
    3 * DEATHS
)  # deaths in a row, for each worker, without a run between them: it is not the runs
CAUSES = 'look for what ends them (memory?); a script that runs a study needs `if __name__ == "__main__":`'
DEAD = "died"  # a run's status: whatever worker had it ended

Tell = Callable[
    [int, int], None
]  # how many runs came in now, and how many of them did not walk to the end


@dataclass(frozen=True)
class Desk:
    """Where rows go and who hears of it."""

    study: Study
    store: Store
    tell: Tell


class _Sizes:
    """How many runs make a chunk, from how long they took so far."""

    def __init__(self) -> None:
        self._runs, self._time = 0, 0.0

    def learn(self, done: Iterable[Done]) -> None:
        for item in done:
            self._runs, self._time = self._runs + 1, self._time + item.wall

    def of_chunk(self, workers: int) -> int:
        if not self._runs:
            return 1
        return int(min(max(chunk_time(workers) * self._runs / max(self._time, 1e-9), 1), MAX_CHUNK))


def chunk_time(workers: int) -> float:
    """s    of work in a chunk, for so many workers"""
    return max(CHUNK_TIME, workers / MOST_CHUNKS)


def conduct(desk: Desk, crew: Crew, orders: Iterable[Order]) -> Generator[list[Done], None, None]:
    """Runs orders and stores them; yields what was stored, for whom it concerns. Stored to the last
    row when the iterator is closed.

    Raises HexapodError when the disk is full or the workers are gone.
    """
    waiting, sizes = iter(orders), _Sizes()
    again: deque[Chunk] = deque()
    flying, useless = 0, 0
    try:
        while True:
            while flying < IN_FLIGHT * crew.size and (
                chunk := _next(again, waiting, sizes.of_chunk(crew.size))
            ):
                crew.hand_in(chunk)
                flying += 1
            if not flying:
                return
            for returned in crew.take():
                flying -= 1
                useless = 0 if returned.done else useless + bool(returned.died)
                if useless > USELESS * crew.size:
                    raise StudyError(
                        "no worker lives to finish a run",
                        got=returned.died,
                        fix=CAUSES,
                        where=desk.study.where,
                    )
                done = [*returned.done, *_given_up(returned)]
                again.extend(_once_more(returned, len(done)))
                sizes.learn(returned.done)
                desk.store.add(row_of(item, desk.study) for item in done)
                desk.tell(len(done), sum(not item.summary.walked for item in done))
                yield done
    finally:
        desk.store.flush()


def _next(again: deque[Chunk], waiting: Iterator[Order], size: int) -> Chunk | None:
    if again:
        return again.popleft()
    orders = tuple(islice(waiting, size))
    return Chunk(orders) if orders else None


def _given_up(returned: Returned) -> list[Done]:
    """A run by itself of which too many workers died: that is its result."""
    chunk = returned.chunk
    if not returned.died or len(chunk.orders) > 1 or chunk.deaths + 1 < DEATHS:
        return []
    return [
        Done(
            chunk.orders[0],
            failed(chunk.orders[0], f"{returned.died}, {DEATHS} times", status=DEAD),
            0.0,
        )
    ]


def _once_more(returned: Returned, done: int) -> list[Chunk]:
    """What of a chunk was not run, to be run again: one by one after a death."""
    chunk = returned.chunk
    rest = replace(chunk, orders=chunk.orders[done:])
    if not rest.orders:
        return []
    return rest.tried_again() if returned.died else [rest]


def missing(done: NDArray[np.bool_]) -> Iterator[int]:
    """Numbers of the runs that are not stored, a block at a time."""
    block = 65_536
    for begin in range(0, len(done), block):
        yield from (begin + np.flatnonzero(~done[begin : begin + block])).tolist()
