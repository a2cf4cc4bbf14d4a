"""The result of a co-simulation run: the outcome with its recording, the metrics and the facts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.master.loop import COMPLETED, Outcome
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models.ground.surface import Surface


@dataclass(frozen=True, kw_only=True)
class Result:
    """A run's scenario, outcome, metrics and facts."""

    scenario: Scenario
    outcome: Outcome
    metrics: Mapping[str, float]
    parameters: Mapping[str, float]  # of the FMU during the run
    facts: Mapping[str, Any]  # robot, FMU, versions, warnings
    surface: Surface | None = None  # that the FMU read from its resources; None: a plane

    @property
    def recording(self) -> Recording:
        """The recorded rows: time, the plant's outputs and inputs, commands."""
        return self.outcome.recording

    @property
    def completed(self) -> bool:
        """Whether the run reached its end."""
        return self.outcome.status == COMPLETED
