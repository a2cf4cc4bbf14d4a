"""The task of a worker: a chunk of orders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from hexapod_cosim.cosim.run.worker_pool import Finished, TaskExecutor
from hexapod_cosim.cosim.study.plan.records import Order
from hexapod_cosim.cosim.study.store.run_result import RunResult

MAX_DEATHS = 3  # of workers that run an order alone, after which it is given up


@dataclass(frozen=True)
class Chunk:
    """Orders that one worker runs one after the other."""

    orders: tuple[Order, ...]
    deaths: int = 0  # of workers that had the chunk when it was a single order
    # whether a worker died that had the chunk: no other chunk waits behind it, so that the cause
    # of another death is known
    suspect: bool = False

    def split(self) -> list[Chunk]:
        """Returns a chunk for each order, after a worker died of one of them."""
        deaths = self.deaths + 1 if len(self.orders) == 1 else 0
        return [Chunk((order,), deaths, suspect=True) for order in self.orders]


# a chunk that returns fewer results than orders was not run to its end
FinishedChunk: TypeAlias = Finished[Chunk, list[RunResult]]
ChunkExecutor: TypeAlias = TaskExecutor[Chunk, list[RunResult]]
