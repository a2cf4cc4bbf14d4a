"""What runs of a point come to: means with 95 % intervals over seeds, and paired changes from the first control to the second.

Runs come sorted, so a point's are next to each other and no more than one point's are held.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import pyarrow as pa

from hexapod_cosim.cosim.comparison import Change, change_of, half_width_of
from hexapod_cosim.cosim.study.columns import FIGURES
from hexapod_cosim.cosim.study.records import SCENARIO_FACTOR, Factor, Study

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Mean:
    """Of a metric over the seeds of a point."""

    value: float  # NaN where no run has the metric
    half_width: float  # of its 95 % interval; NaN for fewer than two runs
    runs: int


@dataclass(frozen=True, kw_only=True)
class Point:
    """A point's runs, by control."""

    number: int
    case: str
    values: Mapping[str, Any]  # of the factors
    held_out: bool
    runs: Mapping[str, int]  # by control
    walked: Mapping[str, int]
    means: Mapping[str, Mapping[str, Mean]]  # by control, then metric
    changes: Mapping[str, Change]  # by metric; empty for a single control


@dataclass(frozen=True, kw_only=True)
class Overall:
    """All runs of a study."""

    runs: int
    walked: Mapping[str, int]  # by control
    total: Mapping[str, int]
    failures: Mapping[tuple[str, str, str], int]  # by control, status and reason, the most frequent first
    changes: Mapping[str, Change]  # over all pairs
    means: Mapping[str, Mapping[str, Mean]]


MOST_REASONS = 30
DIGITS = str.maketrans("0123456789", "#" * 10)


def points_of(tables: Iterable[pa.Table], study: Study) -> Iterator[Point]:
    """The points of sorted runs, one by one."""
    held = set() if study.optimise is None else set(study.optimise.held_out.seeds)
    rows = (row for table in tables for row in table.to_pylist())
    for (_, apart), group in groupby(rows, key=lambda row: (row["point"], row["seed"] in held)):
        yield point_of(list(group), study.factors, held_out=apart)


def point_of(rows: Sequence[Row], factors: Sequence[Factor], *, held_out: bool = False) -> Point:
    """The runs of one point."""
    by_control: dict[str, list[Row]] = {}
    for row in rows:
        by_control.setdefault(row["control"], []).append(row)
    first = rows[0]
    return Point(
        number=first["point"], case=first["case"], held_out=held_out,
        values={factor.name: first["case" if factor.name == SCENARIO_FACTOR else factor.name] for factor in factors},
        runs={name: len(group) for name, group in by_control.items()},
        walked={name: sum(row["walked"] for row in group) for name, group in by_control.items()},
        means={name: {metric: _mean(group, metric) for metric in FIGURES} for name, group in by_control.items()},
        changes=_changes(list(by_control.values())),
    )  # fmt: skip


def _mean(rows: Sequence[Row], metric: str) -> Mean:
    """Over those that walked, if any did."""
    judged = [row for row in rows if row["walked"]] or rows
    values = np.array([row[metric] for row in judged if row[metric] is not None], dtype=np.float64)
    return Mean(float(values.mean()) if len(values) else math.nan, half_width_of(values), len(values))


def _changes(groups: Sequence[Sequence[Row]]) -> dict[str, Change]:
    """Seed by seed, over the pairs in which both walked, if any did; as `hexapod compare` has them."""
    if len(groups) != 2:
        return {}
    second = {(row["case"], row["seed"]): row for row in groups[1]}
    pairs = [(row, second[row["case"], row["seed"]]) for row in groups[0] if (row["case"], row["seed"]) in second]
    judged = [pair for pair in pairs if pair[0]["walked"] and pair[1]["walked"]] or pairs
    return {name: change_of(name, [(_number(a[name]), _number(b[name])) for a, b in judged]) for name in FIGURES}


def _number(value: float | None) -> float:
    return math.nan if value is None else value


class Tally:
    """Adds runs up, table by table; pairs are of runs that stand next to each other, as a study orders them."""

    def __init__(self, controls: Sequence[str]) -> None:
        self._controls = controls
        self._total, self._walked = Counter[str](), Counter[str]()
        self._failures = Counter[tuple[str, str, str]]()
        self._values: dict[str, list[np.ndarray[Any, np.dtype[np.float64]]]] = {name: [] for name in FIGURES}
        self._good: list[np.ndarray[Any, np.dtype[np.bool_]]] = []

    def add(self, table: pa.Table) -> None:
        """A table of whole points."""
        walked = table["walked"].to_numpy()
        controls = np.array(table["control"].to_pylist())
        for control in dict.fromkeys(controls.tolist()):
            self._total[control] += int(np.sum(controls == control))
            self._walked[control] += int(np.sum(walked[controls == control]))
        for row in table.filter(pa.compute.invert(table["walked"])).select(["control", "status", "reason", "warnings"]).to_pylist():
            self._failures[row["control"], row["status"], _reason(row)] += 1
        n = len(self._controls)
        whole = len(controls) // n * n
        self._good.append(walked[:whole].reshape(-1, n))
        for name in FIGURES:
            self._values[name].append(table[name].to_numpy(zero_copy_only=False).astype(np.float64)[:whole].reshape(-1, n))

    def overall(self) -> Overall:
        """All that was added."""
        good = np.concatenate(self._good) if self._good else np.zeros((0, len(self._controls)), dtype=np.bool_)
        values = {name: np.concatenate(parts) if parts else np.zeros((0, len(self._controls))) for name, parts in self._values.items()}
        both = good.all(axis=1) if good.any() else np.ones(len(good), dtype=np.bool_)
        paired = len(self._controls) == 2
        changes = (
            {name: change_of(name, item[both if both.any() else slice(None)].tolist()) for name, item in values.items()} if paired else {}
        )
        means = {
            control: {name: _column_mean(item[good[:, k], k]) for name, item in values.items()} for k, control in enumerate(self._controls)
        }
        return Overall(
            runs=sum(self._total.values()), walked=dict(self._walked), total=dict(self._total),
            failures=dict(self._failures.most_common(MOST_REASONS)), changes=changes, means=means,
        )  # fmt: skip


def _column_mean(values: np.ndarray[Any, np.dtype[np.float64]]) -> Mean:
    finite = values[np.isfinite(values)]
    return Mean(float(finite.mean()) if len(finite) else math.nan, half_width_of(finite), len(finite))


def _reason(row: Row) -> str:
    """Why a run did not walk to its end, without the figures in it, so that like is counted with like."""
    text = str(row["reason"] or row["warnings"].partition(" | ")[0] or "the robot fell")
    return _without_numbers(text)


def _without_numbers(text: str) -> str:
    words = text.translate(DIGITS)
    while "##" in words:
        words = words.replace("##", "#")
    return words.replace("#.#", "#")
