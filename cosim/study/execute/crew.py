"""Who does the work: something that takes chunks of orders and gives back what they came to, in
whatever order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from hexapod_cosim.cosim.study.plan.records import Order
from hexapod_cosim.cosim.study.store.done import Done

IN_FLIGHT = 2  # chunks per worker: the next is there when one is done
DEATHS = 3  # of workers on a run alone, before it is given up


@dataclass(frozen=True)
class Chunk:
    """Orders that one worker runs in a go."""

    orders: tuple[Order, ...]
    deaths: int = 0  # of workers that had it, it being a run by itself
    # a worker died that had it: no other chunk may wait behind it, so that it is known what the
    # next one dies of
    suspect: bool = False

    def tried_again(self) -> list[Chunk]:
        """Each order by itself, after a worker died of one of them."""
        deaths = self.deaths + 1 if len(self.orders) == 1 else 0
        return [Chunk((order,), deaths, suspect=True) for order in self.orders]


@dataclass(frozen=True)
class Returned:
    """A chunk that came back; what is missing of it was not run."""

    chunk: Chunk
    done: Sequence[Done]
    died: str = ""  # how its worker ended, if it did


class Crew(Protocol):
    """Workers of a job."""

    @property
    def size(self) -> int:
        """How many work at once."""
        ...

    def hand_in(self, chunk: Chunk) -> None:
        """Takes a chunk, at once."""
        ...

    def take(self) -> list[Returned]:
        """Waits until a chunk is back. Raises HexapodError when no worker can go on."""
        ...
