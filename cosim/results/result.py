"""What a co-simulation run returns: the outcome with its recording, the metrics and the facts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.master.loop import COMPLETED, Outcome
from hexapod_cosim.cosim.scenario.records import Scenario


@dataclass(frozen=True, kw_only=True)
class Result:
    """A run and what came of it."""

    scenario: Scenario
    outcome: Outcome
    metrics: Mapping[str, float]
    parameters: Mapping[str, float]  # of the FMU, as run
    facts: Mapping[str, Any]  # robot, FMU, versions, warnings

    @property
    def completed(self) -> bool:
        return self.outcome.status == COMPLETED
