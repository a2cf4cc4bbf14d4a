"""Estimates how exact a run's metrics are, from a more exact run of the same walk.

The solver error is the metric minus that of a reference run: the same scenario, seed, gains,
commands and control period with a solver tolerance FINER times smaller or, where the step is fixed,
a solver step FINER_STEP times smaller. It includes how the controller reacts to the difference. The
metrics in TIMED, which depend on the machine, are left out. Over several seeds it is a difference
of means.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from hexapod_cosim.cosim.results.summary import Summary, finite_mean
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.cosim.scenario.records import Scenario

FINER, FINER_STEP = 100.0, 10.0
TIMED = ("realtime_factor",)  # metrics of wall time, which no solver makes more exact
STEP, TOLERANCE = "solver.step", "solver.tolerance"


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Accuracy of one run's metrics, or of their means over several seeds; NaN where none."""

    reference: str  # the setting of the reference, NAME=VALUE
    runs: int  # that are used: those in which both walked; all runs where there are none
    solver_error: Mapping[str, float]  # by metric, in its unit: run minus reference
    notes: tuple[str, ...]  # references that ended differently from the run itself

    @property
    def about(self) -> str:
        """A sentence on what the numbers compare."""
        return f"solver error: less the same walk at {self.reference}"

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON, which `accuracy_from_table` reads."""
        return {"about": self.about, **asdict(self)}


def accuracy_from_table(table: Any) -> Accuracy:
    """Reads a table that `as_table` returned. Raises KeyError or TypeError when it is damaged."""
    given = {item.name: table[item.name] for item in fields(Accuracy)}
    errors = {
        name: math.nan if value is None else float(value)
        for name, value in given["solver_error"].items()
    }
    return Accuracy(**{**given, "solver_error": errors, "notes": tuple(given["notes"])})


def reference_scenario(scenario: Scenario) -> Scenario:
    """Returns the scenario of the reference run, with the finer solver setting."""
    name, value = _finer_setting(scenario)
    if name in scenario.parameters:
        return replace(scenario, parameters={**scenario.parameters, name: value})
    solver = {**scenario.settings.get("solver", {}), name.removeprefix("solver."): value}
    return replace(scenario, settings={**scenario.settings, "solver": solver})


def _finer_setting(scenario: Scenario) -> tuple[str, float]:
    """Returns the reference's setting and its value: the solver's fixed step, or its tolerance."""
    solver, given = scenario_robot(scenario).solver, scenario.parameters
    step = float(given.get(STEP, solver.step))
    if step > 0.0:
        return STEP, step / FINER_STEP
    return TOLERANCE, float(given.get(TOLERANCE, solver.tolerance)) / FINER


def compare_accuracy(
    scenario: Scenario, runs: Sequence[Summary], references: Sequence[Summary]
) -> Accuracy:
    """Returns the accuracy of runs from their reference runs.

    scenario: of the first run; the others may differ from it by their seed.
    """
    name, value = _finer_setting(scenario)
    pairs = list(zip(runs, references, strict=True))
    judged = [pair for pair in pairs if pair[0].walked and pair[1].walked] or pairs
    return Accuracy(
        reference=f"{name}={value:g}",
        runs=len(judged),
        solver_error=_mean_differences(judged),
        notes=tuple(_notes(f"at {name}={value:g}", pairs)),
    )


def _mean_differences(pairs: Sequence[tuple[Summary, Summary]]) -> dict[str, float]:
    """Returns, by metric, the mean of first minus second over the pairs that both have it."""
    names = [name for name in pairs[0][0].metrics if name not in TIMED]
    return {
        name: finite_mean([first.metrics[name] - second.metrics[name] for first, second in pairs])
        for name in names
    }


def _notes(where: str, pairs: Sequence[tuple[Summary, Summary]]) -> list[str]:
    """Describes the references that did not end as the runs did."""
    return [
        f"{run.control}, seed {run.seed}, {where} ended differently: "
        f"{'it walked to the end' if other.walked else other.failure}"
        for run, other in pairs
        if (other.walked, other.status) != (run.walked, run.status)
    ]
