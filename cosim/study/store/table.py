"""Means with 95 % intervals and paired changes, of each point and of all runs.

They are over the runs that walked to the end. Metrics of runs in which the robot fell are in
results.parquet only.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from hexapod_cosim.cosim.results.balance import Unbalanced
from hexapod_cosim.cosim.results.comparison import Change, made_change
from hexapod_cosim.cosim.results.metrics import OF_THE_RUN
from hexapod_cosim.cosim.study.plan.records import SCENARIO_FACTOR, Study
from hexapod_cosim.cosim.study.store.columns import FIGURES
from hexapod_cosim.cosim.study.store.moments import no_moments, ratio_half_widths
from hexapod_cosim.cosim.study.store.sums import SAMPLES, Block, Rows, Sums

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Mean:
    """The mean of a metric over walks."""

    value: float  # NaN where no walk has the metric
    half_width: float  # of its 95 % interval; NaN for fewer than two walks
    runs: int


@dataclass(frozen=True, kw_only=True)
class Point:
    """The results of a point."""

    number: int
    case: str
    values: Mapping[str, Any]  # by factor
    held_out: bool
    runs: Mapping[str, int]  # numbers of runs by control
    walked: Mapping[str, int]  # numbers of walks by control
    # numbers of pairs with the first control, of which both runs walked to the end, by the other
    pairs: Mapping[str, int]
    means: Mapping[str, Mapping[str, Mean]]  # by control and metric
    # from the first control to each other one, by the other one and metric
    changes: Mapping[str, Mapping[str, Change]]


@dataclass(frozen=True, kw_only=True)
class Overall:
    """The results over all runs of a study."""

    runs: int
    walked: Mapping[str, int]  # numbers of walks by control
    total: Mapping[str, int]  # numbers of runs by control
    # numbers of pairs with the first control, of which both runs walked to the end, by the other
    pairs: Mapping[str, int]
    # numbers of runs by control, status and reason, the largest first
    failures: Mapping[tuple[str, str, str], int]
    # over all pairs, from the first control to each other one, by the other one and metric
    changes: Mapping[str, Mapping[str, Change]]
    means: Mapping[str, Mapping[str, Mean]]  # by control and metric
    # numbers of walks, and of walks with any metric, by scenario and control
    walks: Mapping[tuple[str, str], tuple[int, int]]
    unbalanced: Mapping[str, Unbalanced]  # by control


MAX_REASONS = 30  # that are shown
MAX_KINDS = 1000  # of failures that are counted apart, which bounds the memory
OTHER = "other reasons"
NUMBER = re.compile(r"[0-9#]+(?:\.[0-9#]+)?")


def point_at(block: Block, place: int, study: Study) -> Point:
    """Returns the results of one of a block's points."""
    (row,) = block.first.slice(place, 1).to_pylist()
    sums, controls = block.sums[place : place + 1], study.run_controls
    return Point(
        number=row["point"],
        case=row["case"],
        held_out=bool(block.held_out[place]),
        values={
            factor.name: row["case" if factor.name == SCENARIO_FACTOR else factor.name]
            for factor in study.factors
        },
        runs=dict(zip(controls, sums.runs[0].tolist(), strict=True)),
        walked=dict(zip(controls, sums.walked[0].tolist(), strict=True)),
        pairs=dict(zip(controls[1:], sums.pairs[0].tolist(), strict=True)),
        means=_means(sums, study),
        changes=_changes(sums, study),
    )


def _means(sums: Sums, study: Study) -> dict[str, dict[str, Mean]]:
    """Returns the means of the first group by control and metric."""
    found = {}
    for k, control in enumerate(study.run_controls):
        part = sums.moments[0, k]
        parts = zip(
            FIGURES,
            part.value.tolist(),
            part.half_width.tolist(),
            part.count.astype(int).tolist(),
            strict=True,
        )
        found[control] = {
            name: Mean(value, half_width, runs) for name, value, half_width, runs in parts
        }
    return found


def _changes(sums: Sums, study: Study) -> dict[str, dict[str, Change]]:
    """Returns the changes of the first group, as `hexapod compare` computes them.

    They are from the first control to each other one, by the other one and metric.
    """
    others = enumerate(study.run_controls[1:], start=1)
    return {control: _changes_to(sums, k) for k, control in others}


def _changes_to(sums: Sums, other: int) -> dict[str, Change]:
    """Returns the changes of the first group by metric. other: number of the other control."""
    before, after, difference = (part[0] for part in sums.of_pairs(other))
    ratio = ratio_half_widths(before, after, difference)
    parts = (before.value, after.value, difference.half_width, ratio, difference.count.astype(int))
    return {
        name: made_change(
            name, before=first, after=second, half_width=half, log_half_width=log_half, pairs=pairs
        )
        for name, first, second, half, log_half, pairs in zip(
            FIGURES, *(part.tolist() for part in parts), strict=True
        )
    }


class Tally:
    """Accumulates the results over all runs without keeping the runs."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._sums: Sums | None = None
        self._failures = Counter[tuple[str, str, str]]()
        self._walks: dict[tuple[str, str], tuple[int, int]] = {}
        self._unbalanced = dict.fromkeys(study.run_controls, Unbalanced())

    def add(self, rows: Rows) -> None:
        """Adds runs; all runs of a point, scenario and seed must be added together."""
        sums = rows.sums(np.zeros(1, dtype=np.int64))
        self._sums = sums if self._sums is None else self._sums.merged(sums)
        for case, control, walked, figured in _walks(rows.table):
            before = self._walks.get((case, control), (0, 0))
            self._walks[case, control] = before[0] + walked, before[1] + figured
        for control, known in self._unbalanced.items():
            runs = rows.table.filter(pc.equal(rows.table["control"], control))
            found = Unbalanced.among(runs["energy_residual"].to_numpy())
            self._unbalanced[control] = known.merged(found)
        lost = rows.table.filter(pc.invert(rows.table["walked"])).select(
            ["control", "status", "reason", "warnings"]
        )
        for row in lost.to_pylist():
            kind = (row["control"], row["status"], _reason(row))
            if kind not in self._failures and len(self._failures) >= MAX_KINDS:
                kind = (row["control"], row["status"], OTHER)
            self._failures[kind] += 1

    def overall(self) -> Overall:
        """Returns the results over all runs that were added."""
        controls, sums = self._study.run_controls, self._sums or _no_sums(self._study)
        runs, walked = sums.runs[0].tolist(), sums.walked[0].tolist()
        return Overall(
            runs=sum(runs),
            walked=dict(zip(controls, walked, strict=True)),
            total=dict(zip(controls, runs, strict=True)),
            pairs=dict(zip(controls[1:], sums.pairs[0].tolist(), strict=True)),
            failures=dict(self._failures.most_common(MAX_REASONS)),
            changes=_changes(sums, self._study),
            means=_means(sums, self._study),
            walks=dict(self._walks),
            unbalanced=dict(self._unbalanced),
        )


def _walks(table: pa.Table) -> list[tuple[str, str, int, int]]:
    """Returns scenario, control, and the numbers of walks and of walks with any metric."""
    kept = table.filter(table["walked"])
    figured = pc.is_valid(pc.coalesce(*(kept[name] for name in FIGURES if name not in OF_THE_RUN)))
    groups = pa.table(
        {"case": kept["case"], "control": kept["control"], "figured": figured}
    ).group_by(["case", "control"])
    return [
        (row["case"], row["control"], row["figured_count"], row["figured_sum"])
        for row in groups.aggregate([("figured", "count"), ("figured", "sum")]).to_pylist()
    ]


def _no_sums(study: Study) -> Sums:
    size = len(study.run_controls)
    none, others = np.zeros((1, size), dtype=np.int64), size - 1
    moments = no_moments(1, size + SAMPLES * others, len(FIGURES))
    return Sums(runs=none, walked=none, pairs=none[:, 1:], moments=moments)


def _reason(row: Row) -> str:
    """Returns why a run did not walk to the end, without the numbers in the text.

    So reasons that differ in numbers only are counted together.
    """
    text = str(row["reason"] or row["warnings"].partition(" | ")[0] or "the robot fell")
    return NUMBER.sub("#", text)
