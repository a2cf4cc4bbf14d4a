"""The goals of the control, computed from the figures of a course.

A goal compares a value of a control with a bound. It is reached where the value keeps the bound;
surely, where the whole interval does. Values without an interval or cases are no goals reached.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hexapod_cosim.extensions.course.statistics import Interval, Rate
from hexapod_cosim.extensions.course.table import CaseFigures, Table

HALF = 0.5  # share of failures of the reference that makes a height critical
SWEEPS = ("rough", "stairs")
NOT_RUN = "not run"


@dataclass(frozen=True)
class Measured:
    """A value that a goal is judged by."""

    value: Interval
    note: str = ""  # which cases it is of


@dataclass(frozen=True)
class Goal:
    """A goal: a value of a control is to be at most, or at least, a bound."""

    name: str
    text: str
    bound: float
    measure: Callable[[Table, str], Measured]
    at_least: bool = False
    percent: bool = True  # shown as a share or ratio in %


@dataclass(frozen=True)
class Verdict:
    """A goal with what was measured of a control."""

    goal: Goal
    control: str
    measured: Measured

    @property
    def was_run(self) -> bool:
        """Whether the cases of the goal were run."""
        return self.measured.note != NOT_RUN

    @property
    def reached(self) -> bool | None:
        """Whether the value keeps the bound; None where there is no value."""
        value = self.measured.value.value
        return None if math.isnan(value) else self._keeps(value)

    @property
    def sure(self) -> bool:
        """Whether the whole interval lies on the value's side of the bound."""
        ends = self.measured.value.low, self.measured.value.high
        return all(map(math.isfinite, ends)) and self._keeps(ends[0]) == self._keeps(ends[1])

    def _keeps(self, value: float) -> bool:
        return value >= self.goal.bound if self.goal.at_least else value <= self.goal.bound

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON."""
        return {
            "name": self.goal.name,
            "text": self.goal.text,
            "control": self.control,
            "bound": self.goal.bound,
            "at_least": self.goal.at_least,
            **self.measured.value.as_table(),
            "note": self.measured.note,
            "reached": self.reached,
            "sure": self.sure,
        }


def class_ratio(kind: str, quantity: str) -> Callable[[Table, str], Measured]:
    """Measures the median over the cases of a class of the ratio to the reference."""

    def measure(table: Table, control: str) -> Measured:
        found = table.classes.get((kind, control))
        if found is None:
            return Measured(Interval(math.nan), NOT_RUN)
        return Measured(found.ratio(quantity), f"median of {found.counted(quantity)} cases")

    return measure


def case_ratio(name: str, quantity: str) -> Callable[[Table, str], Measured]:
    """Measures the ratio of means to the reference in a case."""

    def measure(table: Table, control: str) -> Measured:
        found = table.cases.get((name, control))
        if found is None:
            return Measured(Interval(math.nan), NOT_RUN)
        change = found.change(quantity)
        low, high = change.interval
        return Measured(Interval(1.0 + change.relative, 1.0 + low, 1.0 + high), name)

    return measure


def case_mean(name: str, quantity: str) -> Callable[[Table, str], Measured]:
    """Measures the mean of a quantity in a case."""

    def measure(table: Table, control: str) -> Measured:
        found = table.cases.get((name, control))
        if found is None:
            return Measured(Interval(math.nan), NOT_RUN)
        return Measured(found.mean(quantity), name)

    return measure


def worst_case_mean(kind: str, quantity: str) -> Callable[[Table, str], Measured]:
    """Measures the largest mean of a quantity over the cases of a class."""

    def measure(table: Table, control: str) -> Measured:
        found = [(case.mean(quantity), case) for case in table.cases_of(kind, control)]
        known = [item for item in found if math.isfinite(item[0].value)]
        if not known:
            return Measured(Interval(math.nan), NOT_RUN)
        mean, case = max(known, key=lambda item: item[0].value)
        return Measured(mean, f"largest: {case.case.name}")

    return measure


def class_success(kind: str) -> Callable[[Table, str], Measured]:
    """Measures the successes among all runs of a class."""

    def measure(table: Table, control: str) -> Measured:
        found = table.classes.get((kind, control))
        if found is None:
            return Measured(Interval(math.nan), NOT_RUN)
        return Measured(found.success.interval, f"{found.success.runs} runs")

    return measure


def critical_case(table: Table, sweep: str) -> CaseFigures | None:
    """Returns the lowest case of a sweep in which the reference fails in half of the runs."""
    return next(
        (
            case
            for case in table.sweep(sweep, table.reference)
            if case.success.successes <= (1.0 - HALF) * case.success.runs
        ),
        None,
    )


def success_at_critical_heights(table: Table, control: str) -> Measured:
    """Measures the successes at the heights at which the reference fails in half of the runs."""
    if not all(table.sweep(sweep, table.reference) for sweep in SWEEPS):
        return Measured(Interval(math.nan), NOT_RUN)
    critical = [critical_case(table, sweep) for sweep in SWEEPS]
    names = [case.case.name for case in critical if case is not None]
    if len(names) < len(SWEEPS):
        missing = ", ".join(
            sweep for sweep, case in zip(SWEEPS, critical, strict=True) if case is None
        )
        return Measured(Interval(math.nan), f"{table.reference} does not fail on {missing}")
    rates = [table.cases[name, control].success for name in names]
    both = Rate(sum(rate.successes for rate in rates), sum(rate.runs for rate in rates))
    return Measured(both.interval, " and ".join(names))


SAME = "same gait, sticking ground"
GOALS = (
    Goal(
        "success",
        "rough and stairs, where the reference fails in half: success",
        0.95,
        success_at_critical_heights,
        at_least=True,
    ),
    Goal("rough peak", "rough: peak force to reference", 0.5, class_ratio("rough", "peak")),
    Goal("rough loading", "rough: loading rate to reference", 0.4, class_ratio("rough", "loading")),
    Goal("flat torque", "flat: joint torque to reference", 1.0, case_ratio("flat_tanh", "torque")),
    Goal(
        "flat electrical",
        "flat: electrical energy to reference",
        1.0,
        case_ratio("flat_tanh", "electrical"),
    ),
    Goal(
        "sticking slip",
        "flat, sticking: slip to reference",
        0.6,
        case_ratio("flat_sticking", "slip"),
    ),
    Goal("same heat", f"{SAME}: heat to reference", 1.15, case_ratio("flat_same", "heat")),
    Goal("same slip", f"{SAME}: slip to reference", 0.6, case_ratio("flat_same", "slip")),
    Goal("tanh slip", "flat, tanh law: slip to reference", 0.4, case_ratio("flat_tanh", "slip")),
    Goal("tanh heat", "flat, tanh law: heat to reference", 1.5, case_ratio("flat_tanh", "heat")),
    Goal("servos", "flat: hottest servo of its rating", 1.0, case_mean("flat_tanh", "load")),
    Goal("push success", "pushes: success", 0.95, class_success("pushes"), at_least=True),
    Goal("push peak", "pushes: peak force to reference", 1.0, class_ratio("pushes", "peak")),
    Goal("push path", "pushes: path error to reference", 1.0, class_ratio("pushes", "path")),
    Goal(
        "payload slip",
        "payload: slip [m/m]",
        0.02,
        worst_case_mean("payload", "slip"),
        percent=False,
    ),
    Goal("payload roll", "payload: roll to reference", 1.0, class_ratio("payload", "roll")),
)


def verdicts(table: Table) -> tuple[Verdict, ...]:
    """Returns all goals with what was measured, of each column but that of the reference."""
    columns = [column for column in table.columns if column != table.reference]
    return tuple(
        Verdict(goal, column, goal.measure(table, column)) for goal in GOALS for column in columns
    )
