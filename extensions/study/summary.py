"""Reads the results of a study's folder; writes points.parquet and summary.json."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import RUN_FILE, read_json, write_json
from hexapod_cosim.cosim.results.balance import UNBALANCED, Unbalanced
from hexapod_cosim.cosim.results.metrics import OF_THE_RUN
from hexapod_cosim.extensions.study.folder import MANIFEST, provenance, write_table
from hexapod_cosim.extensions.study.groups import Groups, Point
from hexapod_cosim.extensions.study.moments import Figures
from hexapod_cosim.extensions.study.objective import WALKED
from hexapod_cosim.extensions.study.reading import study_from_table
from hexapod_cosim.extensions.study.records import SCENARIO_FACTOR, Optimise, Study, Value
from hexapod_cosim.extensions.study.store import (
    BOOLEAN,
    FIGURES,
    INTEGER,
    REAL,
    TEXT,
    UNITS,
    WARNING_SEPARATOR,
    Column,
    Store,
    columns_of,
    quoted,
)
from hexapod_cosim.models import HexapodError

POINTS, SUMMARY, OPTIMUM = "points.parquet", "summary.json", "optimum.json"
HALF_WIDTH = ".half_width"  # suffix of columns with half widths of 95 % intervals
MAX_REASONS = 30  # that are shown
NUMBER = re.compile(r"[0-9#]+(?:\.[0-9#]+)?")


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The settings of a trial of an optimiser and its results on the training runs."""

    number: int
    values: tuple[Value, ...]
    means: Mapping[str, float]  # by metric of the objectives and constraints
    feasible: bool


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
    # numbers of walks, and of walks with any metric, by scenario and control
    walks: Mapping[tuple[str, str], tuple[int, int]]
    unbalanced: Mapping[str, Unbalanced]  # by control
    trials: list[Trial]  # of an optimiser
    optimum: Mapping[str, Any] | None
    wall: float  # s    sum of the elapsed times of all runs

    @property
    def runs(self) -> int:
        """Number of runs."""
        return sum(self.overall.runs.values())


def stored_study(folder: Path) -> tuple[Study, dict[str, Any]]:
    """Reads the study of a folder and its manifest. Raises HexapodError when there is none."""
    try:
        manifest: dict[str, Any] = read_json(folder / MANIFEST)
    except HexapodError as error:
        raise HexapodError(
            "not a study's folder",
            got=str(folder),
            expected=f"a folder with {MANIFEST}",
            fix="give a folder written by `hexapod study`",
        ) from error
    where = str(folder / MANIFEST)
    study = study_from_table(manifest["study"], where=where, scenarios=manifest["scenarios"])
    # a study without a title has the name of its file
    return replace(study, title=manifest["title"]), manifest


def read_results(folder: Path) -> Results:
    """Reads the results of a study, also of one that runs, and writes the tables of them.

    Raises HexapodError when the folder holds no study or its file of runs is damaged.
    """
    study, manifest = stored_study(folder)
    with closing(Store(folder, study)) as store:
        groups = Groups(study, store)
        columns = point_columns(study)
        rows = ([point_row(point) for point in block] for block in groups.blocks())
        write_table(folder / POINTS, columns, rows, provenance(manifest))
        results = Results(
            study=study,
            manifest=manifest,
            facts=read_json(folder / RUN_FILE),
            overall=groups.overall,
            points=groups.points,
            of_points=groups.count,
            failures=failure_counts(store),
            walks=_walks(store),
            unbalanced=_unbalanced(store),
            trials=trials_of(study, groups.points),
            optimum=read_json(folder / OPTIMUM) if (folder / OPTIMUM).exists() else None,
            wall=store.select("SELECT total(wall) FROM runs")[0][0],
        )
    write_json(folder / SUMMARY, summary_of(results))
    return results


def failure_counts(store: Store) -> dict[tuple[str, str, str], int]:
    """Returns the numbers of runs that did not walk, by control, status and reason."""
    store.database.create_function("kind", 2, _reason, deterministic=True)
    rows = store.select(
        "SELECT control, status, kind(reason, warnings) AS why, count(*) AS number FROM runs"
        " WHERE NOT walked GROUP BY control, status, why"
        f" ORDER BY number DESC, control, status, why LIMIT {MAX_REASONS}"
    )
    return {(control, status, why): number for control, status, why, number in rows}


def _reason(reason: str, warnings: str) -> str:
    """Returns why a run did not walk to the end, without the numbers in the text.

    So reasons that differ in numbers only are counted together.
    """
    text = reason or warnings.partition(WARNING_SEPARATOR)[0] or "the robot fell"
    return NUMBER.sub("#", text)


def _walks(store: Store) -> dict[tuple[str, str], tuple[int, int]]:
    """Returns the numbers of walks and of walks with any metric, by scenario and control."""
    figures = ", ".join(quoted(name) for name in FIGURES if name not in OF_THE_RUN)
    rows = store.select(
        f'SELECT "case", control, count(*), sum(coalesce({figures}) IS NOT NULL) FROM runs'
        ' WHERE walked GROUP BY "case", control ORDER BY min(run)'
    )
    return {(case, control): (walks, figured) for case, control, walks, figured in rows}


def _unbalanced(store: Store) -> dict[str, Unbalanced]:
    """Returns the runs whose energy balance does not close, by control."""
    rows = store.select(
        "SELECT control, count(*), max(energy_residual) FROM runs WHERE energy_residual > ?"
        " GROUP BY control ORDER BY control",
        (UNBALANCED,),
    )
    return {control: Unbalanced(count, largest) for control, count, largest in rows}


def feasible(means: Mapping[str, float], asked: Optimise) -> bool:
    """Returns whether the means meet all constraints."""
    return all(bound.excess(means[bound.metric]) <= 0.0 for bound in asked.constraints)


def trials_of(study: Study, points: Sequence[Point]) -> list[Trial]:
    """Returns the trials of which all training runs are stored, from the points of the study."""
    asked, found = study.optimise, []
    if asked is None:
        return []
    for point in points:
        runs, walked = (kind[asked.control] for kind in (point.figures.runs, point.figures.walked))
        if point.held_out or point.number >= asked.trials or runs < asked.training.runs:
            continue
        means = {
            name: item.value if walked == runs else math.nan
            for name, item in point.figures.means[asked.control].items()
        } | {WALKED: walked / runs}
        values = tuple(point.values[factor.name] for factor in study.factors)
        fits = feasible(means, asked)
        found.append(Trial(number=point.number, values=values, means=means, feasible=fits))
    return found


def summary_of(results: Results) -> dict[str, Any]:
    """Returns the content of summary.json: totals, means, changes, failures and the optimum."""
    overall = results.overall
    changes = {
        control: {name: change.as_table() for name, change in found.items()}
        for control, found in overall.changes.items()
    }
    if len(changes) > 1:  # by the other control
        paired = {"pairs": dict(overall.pairs), "changes": changes}
    else:
        paired = {
            "pairs": sum(overall.pairs.values()),
            "change": next(iter(changes.values()), {}),
        }
    return {
        "title": results.study.title,
        "runs": results.runs,
        "of": results.manifest["runs"],
        "points": results.of_points,
        "walked": dict(overall.walked),
        "run_by_control": dict(overall.runs),
        **paired,
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


def point_columns(study: Study) -> list[Column]:
    """Returns the columns of points.parquet.

    They are the settings; for each control the numbers of runs and walks and the means of the
    metrics with the half widths of their intervals; then the pairs and their changes. With more
    than two controls the names of the latter begin with the other control.
    """
    settings = {factor.name for factor in study.factors} | {"point", "case"}
    columns = [item for item in columns_of(study) if item.name in settings]
    columns.append(Column("held_out", BOOLEAN))
    for control in study.controls:
        columns += [Column(f"{control}.{name}", INTEGER) for name in ("runs", "walked")]
        columns += _figure_columns(control)
    others = study.controls[1:]
    for before in [""] if len(others) == 1 else [f"{control}." for control in others]:
        columns.append(Column(f"{before}pairs", INTEGER))
        columns += _figure_columns(f"{before}change")
        columns += [Column(f"{before}change.{name}.verdict", TEXT) for name in FIGURES]
    return columns


def _figure_columns(prefix: str) -> list[Column]:
    return [
        Column(f"{prefix}.{name}{part}", REAL, UNITS[name])
        for name in FIGURES
        for part in ("", HALF_WIDTH)
    ]


def point_row(point: Point) -> list[Any]:
    """Returns the row of a point, in the order of point_columns()."""
    figures = point.figures
    settings = [value for name, value in point.values.items() if name != SCENARIO_FACTOR]
    row = [point.number, point.case, *settings, point.held_out]
    for control, means in figures.means.items():
        row += [figures.runs[control], figures.walked[control]]
        row += [part for item in means.values() for part in (item.value, item.half_width)]
    for control, changes in figures.changes.items():
        row.append(figures.pairs[control])
        row += [part for item in changes.values() for part in (item.difference, item.half_width)]
        row += [item.verdict for item in changes.values()]
    return row
