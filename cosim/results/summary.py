"""What a run came to, without its recording: small enough to be sent and kept by the thousand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError

REFUSED = "refused"  # beside the master's ways to end: the run did not begin
NO_FIGURES = dict.fromkeys(METRICS, math.nan)


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What a run came to."""

    control: str
    seed: int
    status: str  # COMPLETED, FAILED or REFUSED
    reason: str = ""  # in words, "" when completed
    upright: bool = False  # to the end
    fallback: float | None = (
        # share of time in which the controller fell back to kinematic control; None: it does not
        # say
        None
    )
    warnings: tuple[str, ...] = ()
    metrics: Mapping[str, float]  # NaN where there is none; all of them unless completed

    @property
    def walked(self) -> bool:
        """Whether the run came to its end with the robot on its feet."""
        return self.status == COMPLETED and self.upright


def summarise(result: Result) -> Summary:
    """A run without its recording."""
    scenario, walk = result.scenario, result.facts["walk"]
    return Summary(
        control=scenario.control,
        seed=scenario.seed,
        status=result.outcome.status,
        reason=result.outcome.reason,
        upright=walk["upright"],
        fallback=walk.get("fallback"),
        warnings=tuple(result.facts["warnings"]),
        metrics=dict(result.metrics) if result.completed else NO_FIGURES,
    )


def refused(scenario: Scenario, error: HexapodError) -> Summary:
    """A run that could not begin, and why."""
    return Summary(
        control=scenario.control,
        seed=scenario.seed,
        status=REFUSED,
        reason=str(error),
        metrics=NO_FIGURES,
    )
