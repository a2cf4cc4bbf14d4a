"""How exact a run's metrics are: the same walk once more with a finer integration, and once more
with half the macro-step.

Two numbers stand beside every metric.

- The solver's error is the metric less that of a reference: the same scenario, seed, gains,
  commands and control period, integrated FINER times as exactly in tolerance or, where the step is
  fixed, with a step FINER_STEP times as short. The controller is in the loop, so what it makes of
  the difference is part of it.
- The effect of the macro-step is the metric with half the macro-step less the metric as it is. The
  controller then acts, and outputs are read, twice as often; gains that were designed for the run
  are designed anew for the shorter period, given ones stay. So this is no error of the run but says
  how far its figures hang on the macro-step that the scenario chose.

Metrics are taken as they come, by name; the clock's (TIMED) are left out. Over several seeds both
numbers are of the means.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.scenario.checks import check_steps
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.scenario import scenario_robot
from hexapod_cosim.models import HexapodError, ScenarioError

FINER, FINER_STEP = 100.0, 10.0
TIMED = ("realtime_factor",)  # metrics of the clock on the wall, which no solver makes more exact
STEP, TOLERANCE = "solver.step", "solver.tolerance"


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Of one run's metrics, or of their means over several seeds; NaN where a run has no such
    metric.
    """

    reference: str  # the setting of the reference, NAME=VALUE
    macro_step: float  # s    half of the run's
    runs: int  # in which all three walked, or of which all three have figures where none did
    solver_error: Mapping[str, float]  # by metric, in its unit: run less reference
    macro_step_effect: Mapping[
        str, float
    ]  # by metric, in its unit: with half the macro-step less run
    notes: tuple[str, ...]  # where a run that was made for this did not go as the run itself

    @property
    def about(self) -> str:
        """What the numbers compare."""
        return (
            f"solver error: less the same walk at {self.reference}; "
            f"half the macro-step: the same walk at macro_step={self.macro_step:g} less this one"
        )

    def as_table(self) -> dict[str, Any]:
        """For JSON; `accuracy_of_table` reads it."""
        return {
            "about": self.about,
            "reference": self.reference,
            "macro_step": self.macro_step,
            "runs": self.runs,
            "solver_error": dict(self.solver_error),
            "macro_step_effect": dict(self.macro_step_effect),
            "notes": list(self.notes),
        }


def accuracy_of_table(table: Any, *, where: str) -> Accuracy:
    """What `as_table` gave, read from a file. Raises HexapodError when it is damaged."""
    try:
        return Accuracy(
            reference=str(table["reference"]),
            macro_step=float(table["macro_step"]),
            runs=int(table["runs"]),
            solver_error=_numbers(table["solver_error"]),
            macro_step_effect=_numbers(table["macro_step_effect"]),
            notes=tuple(map(str, table["notes"])),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        fix = "run it again with --check-accuracy"
        raise HexapodError(
            "damaged accuracy",
            got=repr(error),
            expected="what --check-accuracy wrote",
            fix=fix,
            where=where,
        ) from error


def _numbers(values: Mapping[str, float | None]) -> dict[str, float]:
    return {name: math.nan if value is None else float(value) for name, value in values.items()}


def finer(scenario: Scenario) -> Scenario:
    """The reference's scenario."""
    name, value = _finer_setting(scenario)
    if name in scenario.parameters:
        return replace(scenario, parameters={**scenario.parameters, name: value})
    solver = {**scenario.settings.get("solver", {}), name.removeprefix("solver."): value}
    return replace(scenario, settings={**scenario.settings, "solver": solver})


def _finer_setting(scenario: Scenario) -> tuple[str, float]:
    """What the reference sets, and to what: the fixed step where there is one, which knows no
    tolerance, else the tolerance.
    """
    solver, given = scenario_robot(scenario).solver, scenario.parameters
    step = float(given.get(STEP, solver.step))
    return (
        (STEP, step / FINER_STEP)
        if step > 0.0
        else (TOLERANCE, float(given.get(TOLERANCE, solver.tolerance)) / FINER)
    )


def halved(scenario: Scenario) -> Scenario:
    """The same with half the macro-step. Raises ScenarioError where that makes too many steps."""
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


def judge_accuracy(
    scenario: Scenario,
    runs: Sequence[Summary],
    references: Sequence[Summary],
    halves: Sequence[Summary],
) -> Accuracy:
    """What the same walks, run by run, came to three times: as they are, by `finer` and by `halved`
    of their scenarios.

    scenario: of the first run; the others may differ from it by their seed.
    """
    name, value = _finer_setting(scenario)
    reference, half = f"{name}={value:g}", halved(scenario).macro_step
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
    """By metric, the mean of first less second over the pairs that both have it."""
    names = [name for name in pairs[0][0].metrics if name not in TIMED]
    return {
        name: _mean([first.metrics[name] - second.metrics[name] for first, second in pairs])
        for name in names
    }


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return float(np.mean(known)) if known else math.nan


def _notes(where: str, runs: Sequence[Summary], others: Sequence[Summary]) -> list[str]:
    """Which of the other runs ended otherwise than the runs did."""
    found = []
    for run, other in zip(runs, others, strict=True):
        if other.walked == run.walked and other.status == run.status:
            continue
        how = other.reason or (
            other.warnings[0]
            if other.status == COMPLETED and not other.upright and other.warnings
            else "it walked on"
        )
        found.append(f"{run.control}, seed {run.seed}, {where} went another way: {how}")
    return found
