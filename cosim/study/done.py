"""A run of a study that has ended."""

from __future__ import annotations

from dataclasses import dataclass

from hexapod_cosim.cosim.study.records import Order
from hexapod_cosim.cosim.summary import Summary


@dataclass(frozen=True)
class Done:
    """A run and what it came to."""

    order: Order
    summary: Summary
    wall: float  # s
