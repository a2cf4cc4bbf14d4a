"""The result of one run of a study."""

from __future__ import annotations

from dataclasses import dataclass

from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.study.plan.records import Order


@dataclass(frozen=True)
class RunResult:
    """A run that has ended, with its summary."""

    order: Order
    summary: Summary
    wall: float  # s    elapsed time
