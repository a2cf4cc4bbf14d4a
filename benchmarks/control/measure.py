"""Runs cases under both controls over seeds in one batch; equal runs of several cases run once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import tomlkit

from benchmarks.control.cases import Case
from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.results.comparison import Comparison, compare_runs
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import ScenarioError, load_robot

COMPARED = ("kinematic", "compliant")  # the two controls of each comparison
Progress = Callable[[int, int], None]  # runs done, of how many


@dataclass(frozen=True, kw_only=True)
class Section:
    """The cases and seeds of one table."""

    name: str
    cases: Sequence[Case]
    seeds: range


Measured = Mapping[str, Mapping[str, Comparison]]  # by section, then case


def measure(
    sections: Sequence[Section],
    *,
    cycles: float | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Measured:
    """Runs all cases of all sections.

    Args:
        cycles: duration of every run in gait cycles; None: that of the scenario.
        workers: number of worker processes; None: one for each processor.
        progress: is called with the number of finished runs and of all runs.
    """
    places = [
        (section, case, control)
        for section in sections
        for case in section.cases
        for control in COMPARED
    ]
    plans: dict[str, Scenario] = {}
    wanted = [
        [_place(plans, case, control, seed, cycles) for seed in section.seeds]
        for section, case, control in places
    ]
    runs = dict(zip(plans, _walk(list(plans.values()), workers, progress), strict=True))
    found: dict[str, dict[str, Comparison]] = {section.name: {} for section in sections}
    walked = [[run if isinstance(run, Summary) else runs[run] for run in row] for row in wanted]
    for (section, case, _), first, second in zip(
        places[::2], walked[::2], walked[1::2], strict=True
    ):
        found[section.name][case.name] = compare_runs(first, second)
    return found


def _place(
    plans: dict[str, Scenario], case: Case, control: str, seed: int, cycles: float | None
) -> str | Summary:
    """Adds the run of a case to the plans and returns its key, or the refusal of an unknown
    case.
    """
    try:
        plan = case.plan(control, seed)
    except ScenarioError as error:
        return Summary(
            control=control, seed=seed, status=REFUSED, reason=str(error), metrics=NO_FIGURES
        )
    plan = (
        plan
        if cycles is None
        else replace(
            plan, duration=plan.macro_step * round(cycles * _period(plan) / plan.macro_step)
        )
    )
    key = tomlkit.dumps(plan.to_table())
    plans.setdefault(key, plan)
    return key


def _period(plan: Scenario) -> float:
    return make_gait(load_robot(plan.robot), **dict(plan.settings.get("gait", {}))).period


def _walk(
    plans: Sequence[Scenario], workers: int | None, progress: Progress | None
) -> list[Summary]:
    done: list[Summary] = []
    with closing(run_batch(plans, workers=workers, compiled=True)) as runs:
        for run in runs:
            done.append(run)
            if progress is not None:
                progress(len(done), len(plans))
    return done
