"""A run of a study that has ended."""

from __future__ import annotations

from dataclasses import dataclass

from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.study.plan.records import Order


@dataclass(frozen=True)
class Done:
    """A run and what it came to."""

    order: Order
    summary: Summary
    wall: float  # s
