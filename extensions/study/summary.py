"""Reads the results of a study's folder, with figures of all runs and of points.

Means are over the runs that walked to the end; metrics of runs in which the robot fell are in
results.parquet only. A pair consists of two runs of the same point, scenario and seed: one under
the first control, which is the reference, and one under another control. A run whose partner is
missing counts in the means of its control and not in the changes.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.common.files import RUN_FILE, read_json, write_json
from hexapod_cosim.cosim.results.comparison import Change, change_of, half_width_of
from hexapod_cosim.cosim.results.metric_table import OF_THE_RUN
from hexapod_cosim.extensions.study.folder import MANIFEST, OPTIMUM
from hexapod_cosim.extensions.study.reading import study_from_table
from hexapod_cosim.extensions.study.records import SCENARIO_FACTOR, Study
from hexapod_cosim.extensions.study.store import FIGURES, WARNING_SEPARATOR, Store, quoted
from hexapod_cosim.models.arrays import Array

SUMMARY = "summary.json"
POINT_METRICS = ("slip_per_metre", "cost_of_transport", "peak_force", "torque_rms")
MAX_POINTS = 4000  # kept for figures and tables; evenly chosen if there are more
MAX_REASONS = 30  # that are shown
NUMBER = re.compile(r"[0-9#]+(?:\.[0-9#]+)?")
ALL_PAIRS = slice(None)


@dataclass(frozen=True)
class Mean:
    """The mean of a metric over walks."""

    value: float  # NaN where no walk has the metric
    half_width: float  # of its 95 % interval; NaN for fewer than two walks
    runs: int


@dataclass(frozen=True, kw_only=True)
class Figures:
    """The figures of a group of runs."""

    runs: Mapping[str, int]  # numbers of runs by control
    walked: Mapping[str, int]  # numbers of walks by control
    # numbers of pairs with the first control, of which both runs walked to the end, by the other
    pairs: Mapping[str, int]
    means: Mapping[str, Mapping[str, Mean]]  # by control and metric
    # from the first control to each other one, by the other one and metric
    changes: Mapping[str, Mapping[str, Change]]


@dataclass(frozen=True, kw_only=True)
class Point:
    """The results of a point."""

    number: int
    values: Mapping[str, Any]  # by factor
    held_out: bool  # from the optimiser
    figures: Figures


class Runs:
    """The stored runs of a study as arrays over pairs: runs that differ by their control alone.

    Attributes:
        point: numbers of the points (pairs,), ascending.
        stored, walked: which runs are stored and walked to the end (pairs, controls).
        values: metrics of the walks (pairs, controls, metrics), NaN for other runs.
    """

    def __init__(self, study: Study, store: Store) -> None:
        self.study, controls = study, len(study.controls)
        rows = store.select(
            f"SELECT run, point, walked, {', '.join(map(quoted, FIGURES))} FROM runs ORDER BY run"
        )
        number = np.array([row[0] for row in rows], dtype=np.int64)
        _, first, pair = np.unique(number // controls, return_index=True, return_inverse=True)
        place = pair, number % controls
        self.point = np.array([rows[row][1] for row in first], dtype=np.int64)
        self.stored = np.zeros((len(first), controls), dtype=np.bool_)
        self.walked = np.zeros_like(self.stored)
        self.values = np.full((len(first), controls, len(FIGURES)), math.nan)
        self.stored[place] = True
        self.walked[place] = [row[2] for row in rows]
        self.values[place] = np.array([row[3:] for row in rows], float).reshape(-1, len(FIGURES))
        self.values[~self.walked] = math.nan

    def of_point(self, point: int) -> slice:
        """Returns the places of a point's pairs."""
        return slice(*np.searchsorted(self.point, [point, point + 1]).tolist())

    def figures(self, pairs: slice = ALL_PAIRS, names: Iterable[str] = FIGURES) -> Figures:
        """Returns the figures of some pairs, of the metrics `names`."""
        controls, places = self.study.controls, {name: FIGURES.index(name) for name in names}
        stored, walked, values = self.stored[pairs], self.walked[pairs], self.values[pairs]
        return Figures(
            runs=dict(zip(controls, stored.sum(axis=0).tolist(), strict=True)),
            walked=dict(zip(controls, walked.sum(axis=0).tolist(), strict=True)),
            pairs={
                control: int((walked[:, 0] & walked[:, k]).sum())
                for k, control in enumerate(controls)
                if k
            },
            means={
                control: {name: mean_of(values[:, k, place]) for name, place in places.items()}
                for k, control in enumerate(controls)
            },
            changes={
                control: {
                    name: change_of(name, values[:, [0, k], place])
                    for name, place in places.items()
                }
                for k, control in enumerate(controls)
                if k
            },
        )


def mean_of(values: Array) -> Mean:
    """Returns the mean of values, without those that are NaN."""
    known = values[np.isfinite(values)]
    value = float(known.mean()) if len(known) else math.nan
    return Mean(value, half_width_of(known), len(known))


def points_of(
    runs: Runs, store: Store, *, names: Iterable[str] = FIGURES, most: int = MAX_POINTS
) -> list[Point]:
    """Returns at most `most` points, evenly chosen, with figures of the metrics `names`."""
    study = runs.study
    factors = [factor.name for factor in study.factors]
    columns = ["case" if name == SCENARIO_FACTOR else name for name in factors]
    settings = store.select(
        f"SELECT {', '.join(map(quoted, ['point', *columns]))} FROM runs"
        " GROUP BY point ORDER BY point"
    )
    trials = math.inf if study.optimise is None else study.optimise.trials
    return [
        Point(
            number=number,
            values=dict(zip(factors, values, strict=True)),
            held_out=number > trials,
            figures=runs.figures(runs.of_point(number), names),
        )
        for number, *values in settings[:: max(math.ceil(len(settings) / most), 1)]
    ]


@dataclass(frozen=True, kw_only=True)
class Results:
    """The results of a study so far."""

    study: Study
    manifest: Mapping[str, Any]
    facts: Mapping[str, Any]  # of run.json
    overall: Figures  # of all runs
    points: list[Point]  # MAX_POINTS at most
    of_points: int  # number of all points
    # numbers of runs by control, status and reason, the largest first
    failures: Mapping[tuple[str, str, str], int]
    figured: Mapping[str, bool]  # by control, whether any walk has a metric
    residuals: Mapping[str, Sequence[float]]  # of the energy, by control; NaN without metrics
    optimum: Mapping[str, Any] | None  # the content of optimum.json
    wall: float  # s    sum of the elapsed times of all runs

    @property
    def runs(self) -> int:
        """Number of runs."""
        return sum(self.overall.runs.values())


def read_results(folder: Path) -> Results:
    """Reads the results of a study, also of one that runs, and writes summary.json.

    Raises HexapodError when the folder holds no study or its file of runs is damaged.
    """
    manifest, where = read_json(folder / MANIFEST), str(folder / MANIFEST)
    study = study_from_table(manifest["study"], where=where, scenarios=manifest["scenarios"])
    study = replace(study, title=manifest["title"])  # by default the name of the file
    with closing(Store(folder, study)) as store:
        runs = Runs(study, store)
        of_walks = [FIGURES.index(name) for name in FIGURES if name not in OF_THE_RUN]
        figured = np.isfinite(runs.values[..., of_walks]).any(axis=(0, 2))
        residuals = runs.values[..., FIGURES.index("energy_residual")]
        results = Results(
            study=study,
            manifest=manifest,
            facts=read_json(folder / RUN_FILE),
            overall=runs.figures(),
            points=points_of(runs, store, names=POINT_METRICS, most=MAX_POINTS),
            of_points=len(set(runs.point.tolist())),
            failures=failure_counts(store),
            figured=dict(zip(study.controls, figured.tolist(), strict=True)),
            residuals=dict(zip(study.controls, residuals.T.tolist(), strict=True)),
            optimum=read_json(folder / OPTIMUM) if (folder / OPTIMUM).exists() else None,
            wall=store.select("SELECT total(wall) FROM runs")[0][0],
        )
    write_json(folder / SUMMARY, summary_of(results))
    return results


def failure_counts(store: Store) -> dict[tuple[str, str, str], int]:
    """Returns the numbers of runs that did not walk, by control, status and reason."""
    rows = store.select(
        "SELECT control, status, reason, warnings FROM runs WHERE NOT walked ORDER BY run"
    )
    counted = Counter((control, status, _reason(*texts)) for control, status, *texts in rows)
    return dict(counted.most_common(MAX_REASONS))


def _reason(reason: str, warnings: str) -> str:
    """Returns why a run did not walk to the end, without the numbers in the text.

    So reasons that differ in numbers only are counted together.
    """
    text = reason or warnings.partition(WARNING_SEPARATOR)[0] or "the robot fell"
    return NUMBER.sub("#", text)


def summary_of(results: Results) -> dict[str, Any]:
    """Returns the content of summary.json: totals, means, changes, failures and the optimum."""
    overall = results.overall
    return {
        "title": results.study.title,
        "runs": results.runs,
        "of": results.manifest["runs"],
        "points": results.of_points,
        "walked": dict(overall.walked),
        "run_by_control": dict(overall.runs),
        "pairs": dict(overall.pairs),
        "changes": {
            control: {name: change.as_table() for name, change in found.items()}
            for control, found in overall.changes.items()
        },
        "means": {
            control: {
                name: {"mean": item.value, "half_width": item.half_width, "runs": item.runs}
                for name, item in means.items()
            }
            for control, means in overall.means.items()
        },
        "failures": [
            {"control": control, "status": status, "reason": reason, "runs": count}
            for (control, status, reason), count in results.failures.items()
        ],
        "optimum": results.optimum,
    }
