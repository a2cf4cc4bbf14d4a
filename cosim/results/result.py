"""The result of a co-simulation run: the outcome with its recording, the metrics and the facts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from hexapod_cosim.cosim.master.loop import COMPLETED, Outcome
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.facts import RunFacts
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models.ground.surface import Surface

MAIN = ("slip_per_metre", "peak_force", "path_error", "cost_of_transport")  # of a repr


@dataclass(frozen=True, kw_only=True)
class Result:
    """A run's scenario, outcome, metrics and facts."""

    scenario: Scenario
    outcome: Outcome
    metrics: Mapping[str, float]
    facts: RunFacts
    surface: Surface | None = None  # that the FMU read from its resources; None: a plane

    def __repr__(self) -> str:
        """Returns title, control, status, simulated time and the main metrics that there are."""
        outcome = self.outcome
        found = {name: self.metrics.get(name, math.nan) for name in MAIN}
        figures = [f"{name}={value:.4g}" for name, value in found.items() if math.isfinite(value)]
        parts = [
            f"{self.scenario.title!r}",
            f"control={self.facts.control!r}",
            f"status={outcome.status!r}",
            f"simulated={outcome.simulated:.4g}",
            *figures,
        ]
        return f"Result({', '.join(parts)})"

    @property
    def recording(self) -> Recording:
        """The recorded rows: time, the plant's outputs and inputs, commands."""
        return self.outcome.recording

    @property
    def parameters(self) -> Mapping[str, float]:
        """The FMU's parameters during the run."""
        return self.facts.parameters

    @property
    def completed(self) -> bool:
        """Whether the run reached its end."""
        return self.outcome.status == COMPLETED
