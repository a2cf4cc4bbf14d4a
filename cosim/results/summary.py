"""Summaries of runs without their recordings, small enough to be sent and kept by the thousand."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.scenario.controls import control_of
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError

REFUSED = "refused"  # a status besides those of the master: the run did not start
NO_FIGURES = dict.fromkeys(METRICS, math.nan)

UNBALANCED = 0.01  # share of the motors' work; a larger energy residual causes a warning
FIX = "tighten solver.tolerance or, with a fixed step, shorten solver.step"


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Outcome, warnings and metrics of a run."""

    control: str  # label
    seed: int
    status: str  # COMPLETED, FAILED or REFUSED
    reason: str = ""  # a sentence; "" when completed
    upright: bool = False  # to the end
    # share of time in which the controller fell back to kinematic control; None: unknown
    fallback: float | None = None
    missed: str = ""  # how it missed the end of its commanded path; "" when it arrived
    warnings: tuple[str, ...] = ()
    metrics: Mapping[str, float]  # NaN where undefined, and everywhere unless completed

    @property
    def walked(self) -> bool:
        """Whether the run completed with the robot upright."""
        return self.status == COMPLETED and self.upright

    @property
    def success(self) -> bool:
        """Whether the robot walked upright to the end and arrived, see `arrival`."""
        return self.walked and not self.missed

    @property
    def failure(self) -> str:
        """Why the run is no success; "" for a success."""
        if self.walked:
            return self.missed
        return self.reason or "; ".join(self.warnings) or "the robot fell"


def described_losses(runs: Iterable[Summary]) -> list[str]:
    """Describes the runs in which the robot did not walk to the end or did not arrive."""
    return [f"{run.control}, seed {run.seed}: {run.failure}" for run in runs if not run.success]


def summarise(result: Result) -> Summary:
    """Returns the summary of a run."""
    facts = result.facts
    return Summary(
        control=facts.control,
        seed=result.scenario.seed,
        status=facts.status,
        reason=facts.reason,
        upright=facts.walk.upright,
        fallback=facts.walk.fallback,
        missed=facts.walk.missed,
        warnings=facts.warnings,
        metrics=dict(result.metrics) if result.completed else NO_FIGURES,
    )


def refused_summary(scenario: Scenario, error: HexapodError) -> Summary:
    """Returns the summary of a run that could not start."""
    return Summary(
        control=control_of(scenario.control).label,
        seed=scenario.seed,
        status=REFUSED,
        reason=str(error),
        metrics=NO_FIGURES,
    )


def finite_mean(values: Sequence[float]) -> float:
    """Returns the mean of the finite values, NaN without any."""
    finite = [value for value in values if math.isfinite(value)]
    return float(np.mean(finite)) if finite else math.nan


def balance_warnings(control: str, residuals: Sequence[float], *, runs: int) -> list[str]:
    """Warns of runs whose energy residual is larger than UNBALANCED.

    Args:
        control: of the runs.
        residuals: over the motors' work; NaN for runs without metrics.
        runs: number of runs under the control.
    """
    above = [value for value in residuals if value > UNBALANCED]
    text = (
        f"{control}: the energy balance of {len(above)} of {runs} runs misses more than "
        f"{100.0 * UNBALANCED:g} %, at most {100.0 * max(above, default=0.0):.3g} %: {FIX}"
    )
    return [text] if above else []
