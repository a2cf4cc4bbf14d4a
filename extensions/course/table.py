"""Condenses the runs of a course: figures of each case, and medians over the cases of a class."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hexapod_cosim.cosim.results.comparison import Change, change_of, half_width_of
from hexapod_cosim.cosim.results.metric_table import FLOORS
from hexapod_cosim.cosim.scenario.controls import AT, CHOOSER, reference_of
from hexapod_cosim.cosim.scenario.records import CHOSEN
from hexapod_cosim.extensions.course.records import BY_NAME, QUANTITIES, Case, Course
from hexapod_cosim.extensions.course.runs import Run
from hexapod_cosim.extensions.course.statistics import Interval, Rate, median_ratio
from hexapod_cosim.models.arrays import Array

ALL = "all"  # the class of all cases
LEAST_SHARE = 0.5  # of the pairs of a case that must be successes for its ratio to count


@dataclass(frozen=True)
class CaseFigures:
    """The runs of a case under a control, beside those under the control's reference."""

    case: Case
    control: str  # name of the column
    runs: tuple[Run, ...]
    reference: tuple[Run, ...]  # of the same seeds

    @property
    def success(self) -> Rate:
        """The successes among the runs."""
        return Rate(sum(run.success for run in self.runs), len(self.runs))

    @property
    def failures(self) -> dict[str, int]:
        """Numbers of failed runs by reason."""
        return dict(Counter(run.failure for run in self.runs if run.failure))

    def mean(self, name: str) -> Interval:
        """Returns the mean of a quantity over the successes, with Student's interval."""
        values = _finite(run.values[name] for run in self.runs if run.success)
        if not len(values):
            return Interval(math.nan)
        value, half = float(values.mean()), half_width_of(values)
        return Interval(value, value - half, value + half)

    def pairs(self, name: str) -> Array:
        """Returns the values (n, 2) under reference and control, where both succeeded."""
        found = [
            (before.values[name], after.values[name])
            for before, after in zip(self.reference, self.runs, strict=True)
            if before.success and after.success
        ]
        pairs = np.array(found, dtype=np.float64).reshape(-1, 2)
        return np.asarray(pairs[np.isfinite(pairs).all(axis=1)])

    def change(self, name: str) -> Change:
        """Returns the change of a quantity from the reference, as `hexapod compare` does."""
        return change_of(BY_NAME[name].metric, [(a, b) for a, b in self.pairs(name).tolist()])

    def counts(self, name: str) -> bool:
        """Returns whether the ratio of a quantity counts in medians.

        It does where the reference's mean is above the metric's floor and at least LEAST_SHARE of
        the pairs are successes.
        """
        pairs = self.pairs(name)
        enough = len(pairs) >= max(LEAST_SHARE * len(self.runs), 1.0)
        return enough and float(pairs[:, 0].mean()) > FLOORS[BY_NAME[name].metric]

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON."""
        return {
            "success": self.success.as_table(),
            "failures": self.failures,
            "means": {item.name: self.mean(item.name).as_table() for item in QUANTITIES},
            "changes": {item.name: self.change(item.name).as_table() for item in QUANTITIES},
        }


@dataclass(frozen=True)
class ClassFigures:
    """The cases of a class under a control."""

    name: str
    control: str
    cases: tuple[CaseFigures, ...]

    @property
    def success(self) -> Rate:
        """The successes among all runs of the class."""
        rates = [case.success for case in self.cases]
        return Rate(sum(rate.successes for rate in rates), sum(rate.runs for rate in rates))

    def ratio(self, name: str) -> Interval:
        """Returns the median over cases of a quantity over that under the reference."""
        return median_ratio([case.pairs(name) for case in self.cases if case.counts(name)])

    def counted(self, name: str) -> int:
        """Returns the number of cases in that median."""
        return sum(case.counts(name) for case in self.cases)

    def as_table(self) -> dict[str, Any]:
        """Returns a table for JSON."""
        ratios = {
            item.name: {**self.ratio(item.name).as_table(), "cases": self.counted(item.name)}
            for item in QUANTITIES
        }
        return {"success": self.success.as_table(), "ratios": ratios}


@dataclass(frozen=True)
class Table:
    """All figures of a course, in columns that each compare a control with its reference."""

    course: Course
    controls: tuple[str, ...]  # the first one is the reference of those in its walk
    runs: tuple[Run, ...]

    @property
    def reference(self) -> str:
        """The label of the first control."""
        return self.controls[0]

    @cached_property
    def columns(self) -> Mapping[str, tuple[str, str]]:
        """Controls and their references by the name of a column, which is the control's label.

        Compliant control, which walks in a gait and stance of its own choice, has a second column:
        against the reference in that gait and stance, if this was run.
        """
        found = {label: (label, reference_of(label, self.controls)) for label in self.controls}
        twin = f"{self.reference}{AT}{CHOSEN}"
        if {CHOOSER, twin} <= set(self.controls):
            found[f"{CHOOSER} against {twin}"] = CHOOSER, twin
        return found

    @cached_property
    def cases(self) -> Mapping[tuple[str, str], CaseFigures]:
        """Figures by case and column, of the cases that were run."""
        by_place: dict[tuple[str, str], list[Run]] = {}
        for run in self.runs:
            by_place.setdefault((run.case, run.control), []).append(run)
        return {
            (case.name, column): CaseFigures(
                case,
                column,
                tuple(by_place[case.name, control]),
                tuple(by_place[case.name, reference]),
            )
            for case in self.course.cases
            for column, (control, reference) in self.columns.items()
            if (case.name, control) in by_place
        }

    @cached_property
    def classes(self) -> Mapping[tuple[str, str], ClassFigures]:
        """Figures by class and column, those of all cases last."""
        kinds = [*dict.fromkeys(case.case.kind for case in self.cases.values()), ALL]
        return {
            (kind, column): ClassFigures(kind, column, self.cases_of(kind, column))
            for kind in kinds
            for column in self.columns
        }

    def cases_of(self, kind: str, control: str) -> tuple[CaseFigures, ...]:
        """Returns the cases of a class, or of ALL, under a control."""
        return tuple(
            case
            for case in self.cases.values()
            if case.control == control and kind in (case.case.kind, ALL)
        )

    def sweep(self, name: str, control: str) -> tuple[CaseFigures, ...]:
        """Returns the cases of a sweep under a control, in the order of their heights."""
        found = [case for case in self.cases_of(ALL, control) if case.case.sweep == name]
        return tuple(sorted(found, key=lambda case: case.case.height))


def _finite(values: Iterable[float]) -> Array:
    """Returns the finite ones of some values."""
    found = np.array(list(values), dtype=np.float64)
    return np.asarray(found[np.isfinite(found)])
