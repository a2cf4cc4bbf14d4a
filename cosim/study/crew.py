"""Who does the work: something that takes chunks of orders and gives back what they came to, in whatever order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from hexapod_cosim.cosim.study.records import Order
from hexapod_cosim.cosim.study.worker import Done

DEATHS = 3  # of workers on a run alone, before it is given up


@dataclass(frozen=True)
class Chunk:
    """Orders that one worker runs in a go."""

    orders: tuple[Order, ...]
    deaths: int = 0  # of workers that had it

    def parts(self) -> list[Chunk]:
        """Each order by itself, after a worker died of one of them."""
        return [Chunk((order,), self.deaths) for order in self.orders]


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
