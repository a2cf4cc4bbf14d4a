"""A study's folder read again: its runs so far, points, totals; points.parquet and summary.json."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from hexapod_cosim.cosim.files import RUN_FILE, read_json, to_json
from hexapod_cosim.cosim.study.columns import FIGURES, WALL, schema_of
from hexapod_cosim.cosim.study.manifest import MANIFEST, RUNS
from hexapod_cosim.cosim.study.optimise import OPTIMUM, Optimisation, Trial, trials_of
from hexapod_cosim.cosim.study.reading import study_from_table
from hexapod_cosim.cosim.study.records import SCENARIO_FACTOR, Study
from hexapod_cosim.cosim.study.store import Store, write_durably, write_whole
from hexapod_cosim.cosim.study.table import Mean, Overall, Point, Tally, points_of
from hexapod_cosim.models import HexapodError

POINTS, SUMMARY = "points.parquet", "summary.json"
MOST_POINTS = 4000  # kept for figures and tables, evenly chosen of more


@dataclass(frozen=True, kw_only=True)
class Results:
    """What a study came to so far."""

    study: Study
    manifest: Mapping[str, Any]
    facts: Mapping[str, Any]  # of run.json
    overall: Overall
    points: list[Point]  # MOST_POINTS at most
    of_points: int  # how many there are
    trials: list[Trial]  # of an optimiser
    optimum: Mapping[str, Any] | None
    wall: float  # s    over all runs, of one core


def stored_study(folder: Path) -> tuple[Study, dict[str, Any]]:
    """The study of a folder and its manifest. Raises HexapodError when there is none."""
    try:
        manifest: dict[str, Any] = read_json(folder / MANIFEST)
    except HexapodError as error:
        fix = "give a folder written by `hexapod study`"
        raise HexapodError("not a study's folder", got=str(folder), expected=f"a folder with {MANIFEST}", fix=fix) from error
    where = str(folder / MANIFEST)
    return study_from_table(manifest["study"], where=where, scenarios=manifest["scenarios"]), manifest


def read_results(folder: Path) -> Results:
    """Reads all runs once. Writes points.parquet and summary.json. Raises HexapodError."""
    study, manifest = stored_study(folder)
    store = Store(folder / RUNS, schema_of(study))
    tally, wall, kept, count = Tally(study.run_controls), 0.0, list[Point](), 0

    def watched() -> Iterator[pa.Table]:
        nonlocal wall
        for table in store.sorted_rows():
            tally.add(table)
            wall += pa.compute.sum(table[WALL]).as_py() or 0.0
            yield table

    def chosen() -> Iterator[Point]:
        nonlocal count
        for point in points_of(watched(), study):
            if point.number % step == 0:
                kept.append(point)
            count += 1
            yield point

    step = max(math.ceil(manifest["runs"] / (len(study.seeds) * len(study.run_controls)) / MOST_POINTS), 1) if study.optimise is None else 1
    _write_points(folder / POINTS, chosen(), study)
    trials = [] if study.optimise is None else trials_of(Optimisation(study), kept)
    optimum = read_json(folder / OPTIMUM) if (folder / OPTIMUM).exists() else None
    results = Results(
        study=study, manifest=manifest, facts=read_json(folder / RUN_FILE), overall=tally.overall(), points=kept, of_points=count,
        trials=trials, optimum=optimum, wall=wall,
    )  # fmt: skip
    write_durably(folder / SUMMARY, (to_json(summary_of(results)) + "\n").encode())
    return results


def summary_of(results: Results) -> dict[str, Any]:
    """For JSON: totals, means with half their interval, changes, failures by reason, the optimum."""
    overall = results.overall
    failures = [
        {"control": control, "status": status, "reason": reason, "runs": count}
        for (control, status, reason), count in overall.failures.items()
    ]
    return {
        "title": results.study.title, "runs": overall.runs, "of": results.manifest["runs"], "points": results.of_points,
        "walked": dict(overall.walked), "run_by_control": dict(overall.total),
        "means": {control: {name: _mean(item) for name, item in means.items()} for control, means in overall.means.items()},
        "change": {name: change.as_table() for name, change in overall.changes.items()},
        "failures": failures, "optimum": results.optimum,
    }  # fmt: skip


def _mean(item: Mean) -> dict[str, float]:
    return {"mean": item.value, "half_width": item.half_width, "runs": item.runs}


def _write_points(path: Path, points: Iterator[Point], study: Study) -> None:
    schema = points_schema(study)

    def tables() -> Iterator[pa.Table]:
        rows: list[dict[str, Any]] = []
        for point in points:
            rows.append(_row(point, study))
            if len(rows) == 4096:
                yield pa.Table.from_pylist(rows, schema=schema)
                rows = []
        yield pa.Table.from_pylist(rows, schema=schema)

    write_whole(path, tables(), schema)


def points_schema(study: Study) -> pa.Schema:
    """A point's settings, then by control runs, walked and each metric's mean with half its interval, then the changes."""
    runs = schema_of(study)
    fields = [runs.field(name) for name in ("point", "case")] + [
        runs.field(factor.name) for factor in study.factors if factor.name != SCENARIO_FACTOR
    ]
    fields.append(pa.field("held_out", pa.bool_()))
    for control in study.run_controls:
        fields += [pa.field(f"{control}.runs", pa.int64()), pa.field(f"{control}.walked", pa.int64())]
        fields += [runs.field(name).with_name(f"{control}.{name}{part}") for name in FIGURES for part in ("", ".half_width")]
    if len(study.run_controls) == 2:
        fields += [runs.field(name).with_name(f"change.{name}{part}") for name in FIGURES for part in ("", ".half_width")]
        fields += [pa.field(f"change.{name}.verdict", pa.string()) for name in FIGURES]
    return pa.schema(fields)


def _row(point: Point, study: Study) -> dict[str, Any]:
    row: dict[str, Any] = {"point": point.number, "case": point.case, "held_out": point.held_out, **point.values}
    for control, means in point.means.items():
        row |= {f"{control}.runs": point.runs[control], f"{control}.walked": point.walked[control]}
        for name, item in means.items():
            row |= {f"{control}.{name}": _known(item.value), f"{control}.{name}.half_width": _known(item.half_width)}
    for name, change in point.changes.items():
        row |= {f"change.{name}": _known(change.difference), f"change.{name}.half_width": _known(change.half_width)}
        row[f"change.{name}.verdict"] = change.verdict
    return row


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
