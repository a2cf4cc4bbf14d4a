"""A runner of studies whose walks take no time; a module of its own, which workers import."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.metrics import METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.scenario.records import Scenario


class Instant:
    """A runner whose walks take no time, so that only the overhead of the study remains."""

    def __init__(self, *, controller: Path) -> None:
        self._metrics = {name: 0.123456789 * place for place, name in enumerate(METRICS)}

    def summary(self, scenario: Scenario, **_options: Any) -> Summary:
        """Returns invented metrics at once; see Runner.summary."""
        metrics = {name: value * (1.0 + scenario.seed) for name, value in self._metrics.items()}
        return Summary(
            control=scenario.control,
            seed=scenario.seed,
            status=COMPLETED,
            upright=True,
            metrics=metrics,
        )

    def close(self) -> None:
        """Releases nothing, because this runner holds no files or FMUs."""
