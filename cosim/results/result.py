"""The result of a co-simulation run: the outcome with its recording, the metrics and the facts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.cosim.master.loop import COMPLETED, Outcome
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models.ground.surface import Surface

MAIN = ("slip_per_metre", "peak_force", "path_error", "cost_of_transport")  # of a repr


@dataclass(frozen=True, kw_only=True)
class Result:
    """A run's scenario, outcome, metrics and facts."""

    scenario: Scenario
    outcome: Outcome
    metrics: Mapping[str, float]
    parameters: Mapping[str, float]  # of the FMU during the run
    facts: Mapping[str, Any]  # robot, FMU, versions, warnings
    surface: Surface | None = None  # that the FMU read from its resources; None: a plane

    def __repr__(self) -> str:
        """Returns title, control, status, simulated time and the main metrics that there are."""
        control, outcome = control_of(self.scenario.control).label, self.outcome
        found = {name: self.metrics.get(name, math.nan) for name in MAIN}
        figures = [f"{name}={value:.4g}" for name, value in found.items() if math.isfinite(value)]
        parts = [
            f"{self.scenario.title!r}",
            f"control={control!r}",
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
    def completed(self) -> bool:
        """Whether the run reached its end."""
        return self.outcome.status == COMPLETED
