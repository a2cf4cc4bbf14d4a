"""Reads the results of a study's folder; writes points.parquet and summary.json."""

from __future__ import annotations

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
from hexapod_cosim.extensions.study.groups import (
    Array,
    Figures,
    Groups,
    Point,
    Runs,
    points_of,
    settings_of_points,
)
from hexapod_cosim.extensions.study.optimum import OPTIMUM, Parts, Trial
from hexapod_cosim.extensions.study.reading import study_from_table
from hexapod_cosim.extensions.study.records import Study
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

POINTS, SUMMARY = "points.parquet", "summary.json"
MAX_POINTS = 4000  # kept for figures and tables; evenly chosen if there are more
HALF_WIDTH = ".half_width"  # suffix of columns with half widths of 95 % intervals
MAX_REASONS = 30  # that are shown
NUMBER = re.compile(r"[0-9#]+(?:\.[0-9#]+)?")


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
        runs, settings = Runs(study, store), settings_of_points(study, store)
        groups = Groups(runs, runs.starts())
        write_points(folder / POINTS, runs, groups, settings, provenance(manifest))
        most = len(settings) if study.optimise is not None else MAX_POINTS
        results = Results(
            study=study,
            manifest=manifest,
            facts=read_json(folder / RUN_FILE),
            overall=Groups(runs).figures(0),
            points=points_of(runs, groups, settings, most=max(most, 1)),
            of_points=len(settings),
            failures=failure_counts(store),
            walks=_walks(store),
            unbalanced=_unbalanced(store),
            trials=[] if study.optimise is None else Parts(runs, settings).trials(),
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


def write_points(
    path: Path,
    runs: Runs,
    groups: Groups,
    settings: Sequence[tuple[Any, ...]],
    metadata: Mapping[str, str],
) -> None:
    """Writes points.parquet, a row a point.

    Its columns are the settings; for each control the numbers of runs and walks and the means of
    the metrics with the half widths of their intervals; then the pairs and their changes. With more
    than two controls the names of the latter begin with the other control.
    """
    study, starts = runs.study, groups.starts
    names = ["case", *(factor.name for factor in study.factors)]
    given: dict[str, Any] = {name: [row[k] for row in settings] for k, name in enumerate(names)}
    given["point"] = runs.point[starts]
    table: list[tuple[Column, Any]] = [
        (item, given[item.name]) for item in columns_of(study) if item.name in given
    ]
    table.append((Column("held_out", BOOLEAN), runs.held_out[starts]))
    for control, found in groups.by_control.items():
        table.append((Column(f"{control}.runs", INTEGER), found.runs))
        table.append((Column(f"{control}.walked", INTEGER), found.walked))
        table += _figure_columns(control, found.means.mean, found.means.half_width)
    for control, change in groups.changes.items():
        before = f"{control}." if len(groups.changes) > 1 else ""
        samples = change.samples
        difference = samples["after"].mean - samples["before"].mean
        table.append((Column(f"{before}pairs", INTEGER), change.pairs))
        table += _figure_columns(f"{before}change", difference, samples["change"].half_width)
        table += [
            (Column(f"{before}change.{name}.verdict", TEXT), change.verdict[:, k])
            for k, name in enumerate(FIGURES)
        ]
    columns, arrays = zip(*table, strict=True)
    write_table(path, columns, [arrays], metadata)


def _figure_columns(prefix: str, values: Array, half_widths: Array) -> list[tuple[Column, Array]]:
    """Returns the columns of all metrics with the half widths of their intervals (g, m)."""
    return [
        (Column(f"{prefix}.{name}{suffix}", REAL, UNITS[name]), array[:, k])
        for k, name in enumerate(FIGURES)
        for suffix, array in (("", values), (HALF_WIDTH, half_widths))
    ]
