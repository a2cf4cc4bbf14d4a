"""Estimates how exact a run's metrics are, from two more runs of the same walk.

- The solver error is the metric minus that of a reference run: the same scenario, seed, gains,
  commands and control period with a solver tolerance FINER times smaller or, where the step is
  fixed, a solver step FINER_STEP times smaller. It includes how the controller reacts to the
  difference.
- The effect of the macro-step is the metric with half the macro-step minus the run's own metric.
  The controller then acts, and outputs are read, twice as often; gains that were designed for the
  run are designed again for the shorter period, given gains stay. So this is no error of the run,
  but shows how much its metrics depend on the chosen macro-step.

The metrics in TIMED, which depend on the machine, are left out. Over several seeds both numbers are
differences of means.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.summary import Summary, finite_mean
from hexapod_cosim.cosim.scenario.checks import check_steps
from hexapod_cosim.cosim.scenario.reading import scenario_robot
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import ScenarioError

FINER, FINER_STEP = 100.0, 10.0
TIMED = ("realtime_factor",)  # metrics of wall time, which no solver makes more exact
STEP, TOLERANCE = "solver.step", "solver.tolerance"


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Accuracy of one run's metrics, or of their means over several seeds; NaN where none."""

    reference: str  # the setting of the reference, NAME=VALUE
    macro_step: float  # s    half of the run's
    runs: int  # that are used: those in which all three walked; all runs where there are none
    solver_error: Mapping[str, float]  # by metric, in its unit: run minus reference
    macro_step_effect: Mapping[str, float]  # by metric: run with half the macro-step minus run
    notes: tuple[str, ...]  # extra runs that ended differently from the run itself

    @property
    def about(self) -> str:
        """A sentence on what the two numbers compare."""
        return (
            f"solver error: less the same walk at {self.reference}; "
            f"half the macro-step: the same walk at macro_step={self.macro_step:g} less this one"
        )

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON, which `accuracy_from_table` reads."""
        return {"about": self.about, **asdict(self)}


def accuracy_from_table(table: Any) -> Accuracy:
    """Reads a table that `as_table` returned. Raises KeyError or TypeError when it is damaged."""
    given = {item.name: table[item.name] for item in fields(Accuracy)}
    for name in ("solver_error", "macro_step_effect"):
        given[name] = _numbers(given[name])
    return Accuracy(**{**given, "notes": tuple(given["notes"])})


def _numbers(values: Mapping[str, float | None]) -> dict[str, float]:
    return {name: math.nan if value is None else float(value) for name, value in values.items()}


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


def halved_scenario(scenario: Scenario) -> Scenario:
    """Returns the scenario with half the macro-step.

    Raises ScenarioError where that makes too many steps.
    """
    half = replace(scenario, macro_step=0.5 * scenario.macro_step)
    try:
        check_steps(half)
    except ScenarioError as error:
        raise ScenarioError(
            "too long for --check-accuracy, which halves the macro-step",
            got=error.got,
            expected=error.expected,
            fix=error.fix,
            where=error.where,
        ) from error
    return half


def compare_accuracy(
    scenario: Scenario,
    runs: Sequence[Summary],
    references: Sequence[Summary],
    halves: Sequence[Summary],
) -> Accuracy:
    """Returns the accuracy of runs from their reference runs and their runs with half macro-step.

    scenario: of the first run; the others may differ from it by their seed.
    """
    name, value = _finer_setting(scenario)
    reference, half = f"{name}={value:g}", halved_scenario(scenario).macro_step
    triples = list(zip(runs, references, halves, strict=True))
    judged = [triple for triple in triples if all(run.walked for run in triple)] or triples
    return Accuracy(
        reference=reference,
        macro_step=half,
        runs=len(judged),
        solver_error=_mean_differences([(run, other) for run, other, _ in judged]),
        macro_step_effect=_mean_differences([(other, run) for run, _, other in judged]),
        notes=(
            *_notes(f"at {reference}", runs, references),
            *_notes(f"at macro_step={half:g}", runs, halves),
        ),
    )


def _mean_differences(pairs: Sequence[tuple[Summary, Summary]]) -> dict[str, float]:
    """Returns, by metric, the mean of first minus second over the pairs that both have it."""
    names = [name for name in pairs[0][0].metrics if name not in TIMED]
    return {
        name: finite_mean([first.metrics[name] - second.metrics[name] for first, second in pairs])
        for name in names
    }


def _notes(where: str, runs: Sequence[Summary], others: Sequence[Summary]) -> list[str]:
    """Describes the extra runs that did not end as the runs did."""
    found = []
    for run, other in zip(runs, others, strict=True):
        if other.walked == run.walked and other.status == run.status:
            continue
        how = other.reason or "it walked to the end"
        if not other.reason and other.status == COMPLETED and not other.upright and other.warnings:
            how = other.warnings[0]
        found.append(f"{run.control}, seed {run.seed}, {where} ended differently: {how}")
    return found
