"""Reads the results of a study's folder; writes points.parquet and summary.json."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from hexapod_cosim.cosim.common.files import RUN_FILE, read_json, to_json
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.results.comparison import verdicts
from hexapod_cosim.cosim.study.plan.optimisation import Optimisation
from hexapod_cosim.cosim.study.plan.reading import study_from_table
from hexapod_cosim.cosim.study.plan.records import SCENARIO_FACTOR, Study
from hexapod_cosim.cosim.study.store.columns import FIGURES, WALL, result_schema, schema_of
from hexapod_cosim.cosim.study.store.manifest import MANIFEST, RESULTS, RUNS, TIMES, provenance
from hexapod_cosim.cosim.study.store.moments import Array, ratio_half_widths
from hexapod_cosim.cosim.study.store.store import ROWS_AT_ONCE, Store, write_durably, write_whole
from hexapod_cosim.cosim.study.store.sums import Block, Rows, Sums, blocks_of, whole_pairs
from hexapod_cosim.cosim.study.store.table import Mean, Overall, Point, Tally, point_at
from hexapod_cosim.cosim.study.store.trials import OPTIMUM, Trial, trials_of
from hexapod_cosim.models import HexapodError

POINTS, SUMMARY = "points.parquet", "summary.json"
HALF_WIDTH = ".half_width"  # suffix of columns with half widths of 95 % intervals
MAX_POINTS = 4000  # kept for figures and tables; evenly chosen if there are more


@dataclass(frozen=True, kw_only=True)
class Results:
    """The results of a study so far."""

    study: Study
    manifest: Mapping[str, Any]
    facts: Mapping[str, Any]  # of run.json
    overall: Overall
    points: list[Point]  # MAX_POINTS at most
    of_points: int  # number of all points
    trials: list[Trial]  # of an optimiser
    optimum: Mapping[str, Any] | None
    damaged: list[str]  # descriptions of parts that could not be read
    wall: float  # s    sum of the elapsed times of all runs


def stored_study(folder: Path) -> tuple[Study, dict[str, Any]]:
    """Reads the study of a folder and its manifest. Raises HexapodError when there is none."""
    try:
        manifest: dict[str, Any] = read_json(folder / MANIFEST)
    except HexapodError as error:
        fix = "give a folder written by `hexapod study`"
        raise HexapodError(
            "not a study's folder", got=str(folder), expected=f"a folder with {MANIFEST}", fix=fix
        ) from error
    where = str(folder / MANIFEST)
    study = study_from_table(manifest["study"], where=where, scenarios=manifest["scenarios"])
    # a study without a title has the name of its file
    return replace(study, title=manifest["title"]), manifest


def read_results(folder: Path) -> Results:
    """Reads all runs once; writes points.parquet and summary.json. Raises HexapodError."""
    study, manifest = stored_study(folder)
    facts = read_json(folder / RUN_FILE)
    tables, damaged = _tables(folder, study, finished=facts["status"] == COMPLETED)
    reader = _Reader(study, tables, _point_step(study, manifest["runs"]))
    schema = points_schema(study).with_metadata(provenance(manifest))
    write_whole(folder / POINTS, reader.point_tables(), schema)
    trials = [] if study.optimise is None else trials_of(Optimisation(study), reader.points)
    optimum = read_json(folder / OPTIMUM) if (folder / OPTIMUM).exists() else None
    results = Results(
        study=study,
        manifest=manifest,
        facts=facts,
        overall=reader.tally.overall(),
        points=reader.points,
        of_points=reader.count,
        trials=trials,
        optimum=optimum,
        damaged=damaged,
        wall=reader.wall,
    )
    write_durably(folder / SUMMARY, (to_json(summary_of(results)) + "\n").encode())
    return results


class _Reader:
    """Reads the tables of all runs once and accumulates what Results holds."""

    def __init__(self, study: Study, tables: Iterator[pa.Table], step: int) -> None:
        self._study, self._tables, self._step = study, tables, step
        self.tally = Tally(study)
        self.points: list[Point] = []  # every `step`-th one
        self.count = 0  # of all points
        self.wall = 0.0  # s

    def point_tables(self) -> Iterator[pa.Table]:
        """Yields the rows of points.parquet."""
        for block in blocks_of(self._rows()):
            numbers = block.first["point"].to_numpy()
            places = np.flatnonzero(numbers % self._step == 0).tolist()
            self.points.extend(point_at(block, place, self._study) for place in places)
            self.count += len(block.held_out)
            yield points_table(block, self._study)

    def _rows(self) -> Iterator[Rows]:
        for table in whole_pairs(self._tables, self._study.run_controls):
            self.wall += pc.sum(table[WALL]).as_py() or 0.0
            rows = Rows(table, self._study)
            self.tally.add(rows)
            yield rows


def _point_step(study: Study, runs: int) -> int:
    """Returns every how many points one is kept, for a study of a number of runs."""
    if study.optimise is not None:
        return 1
    points = runs / (len(study.seeds) * len(study.run_controls))
    return max(math.ceil(points / MAX_POINTS), 1)


def _tables(folder: Path, study: Study, *, finished: bool) -> tuple[Iterator[pa.Table], list[str]]:
    """Returns all runs in order, and descriptions of the parts that are left out.

    Runs are read from the parts, which have checksums. When one is damaged, they are read from
    results.parquet of a finished study, or else from the other parts.
    """
    store = Store(folder / RUNS, schema_of(study))
    damaged = store.skip_damaged()
    files = _result_files(folder, study) if finished and (damaged or not store.parts()) else None
    return (store.sorted_rows(), damaged) if files is None else (_file_tables(*files), [])


def _result_files(folder: Path, study: Study) -> tuple[pq.ParquetFile, pq.ParquetFile] | None:
    """Opens results.parquet and times.parquet; None when they are missing or do not match."""
    try:
        files = pq.ParquetFile(folder / RESULTS), pq.ParquetFile(folder / TIMES)
    except (OSError, pa.ArrowException):
        return None
    known = files[0].schema_arrow.names == result_schema(schema_of(study)).names
    return files if known and files[0].metadata.num_rows == files[1].metadata.num_rows else None


def _file_tables(results: pq.ParquetFile, times: pq.ParquetFile) -> Iterator[pa.Table]:
    """Yields the runs with their times, ROWS_AT_ONCE at a time."""
    try:
        batches = (file.iter_batches(ROWS_AT_ONCE) for file in (results, times))
        for runs, durations in zip(*batches, strict=True):
            yield pa.Table.from_batches([runs]).append_column(WALL, durations[WALL])
    except (OSError, pa.ArrowException) as error:
        fix = "start the study again: it runs what is missing and writes them again"
        raise HexapodError(
            "damaged results",
            got=str(error),
            expected=f"{RESULTS} and {TIMES} as they were written",
            fix=fix,
        ) from error


def summary_of(results: Results) -> dict[str, Any]:
    """Returns the content of summary.json: totals, means, changes, failures and the optimum."""
    overall = results.overall
    failures = [
        {"control": control, "status": status, "reason": reason, "runs": count}
        for (control, status, reason), count in overall.failures.items()
    ]
    return {
        "title": results.study.title,
        "runs": overall.runs,
        "of": results.manifest["runs"],
        "points": results.of_points,
        "walked": dict(overall.walked),
        "run_by_control": dict(overall.total),
        **_shared_changes(overall),
        "means": {
            control: {name: _mean(item) for name, item in means.items()}
            for control, means in overall.means.items()
        },
        "failures": failures,
        "optimum": results.optimum,
    }


def _shared_changes(overall: Overall) -> dict[str, Any]:
    """Returns pairs and changes: with two controls as they are, with more by the other control."""
    tables = {
        control: {name: change.as_table() for name, change in changes.items()}
        for control, changes in overall.changes.items()
    }
    if len(tables) > 1:
        return {"pairs": dict(overall.pairs), "changes": tables}
    return {
        "pairs": sum(overall.pairs.values()),
        "change": next(iter(tables.values()), {}),
    }


def _mean(item: Mean) -> dict[str, float]:
    return {"mean": item.value, "half_width": item.half_width, "runs": item.runs}


def points_schema(study: Study) -> pa.Schema:
    """Returns the schema of points.parquet.

    Its columns are the settings; for each control the numbers of runs and walks and the means of
    the metrics with the half widths of their intervals; then the pairs and their changes. With more
    than two controls the names of the latter begin with the other control.
    """
    runs = schema_of(study)
    fields = [runs.field(name) for name in ("point", "case")] + [
        runs.field(factor.name) for factor in study.factors if factor.name != SCENARIO_FACTOR
    ]
    fields.append(pa.field("held_out", pa.bool_()))
    for control in study.run_controls:
        fields += [
            pa.field(f"{control}.runs", pa.int64()),
            pa.field(f"{control}.walked", pa.int64()),
        ]
        fields += [
            runs.field(name).with_name(f"{control}.{name}{part}")
            for name in FIGURES
            for part in ("", HALF_WIDTH)
        ]
    for before in _prefixes(study):
        fields.append(pa.field(f"{before}pairs", pa.int64()))
        fields += [
            runs.field(name).with_name(f"{before}change.{name}{part}")
            for name in FIGURES
            for part in ("", HALF_WIDTH)
        ]
        fields += [pa.field(f"{before}change.{name}.verdict", pa.string()) for name in FIGURES]
    return pa.schema(fields)


def _prefixes(study: Study) -> list[str]:
    """Returns what the names of columns of changes begin with, by the other control."""
    others = study.run_controls[1:]
    return [""] if len(others) == 1 else [f"{control}." for control in others]


def points_table(block: Block, study: Study) -> pa.Table:
    """Returns the rows of points.parquet for a block of points."""
    sums, schema = block.sums, points_schema(study)
    columns: dict[str, Any] = {
        name: block.first[name] for name in schema.names if name in block.first.schema.names
    }
    columns["held_out"] = block.held_out
    for k, control in enumerate(study.run_controls):
        columns |= {f"{control}.runs": sums.runs[:, k], f"{control}.walked": sums.walked[:, k]}
        part = sums.moments[:, k]
        columns |= _by_metric(control, part.value, part.half_width)
    for k, before in enumerate(_prefixes(study)):
        changes = _change_columns(sums, k + 1)
        columns |= {f"{before}{name}": values for name, values in changes.items()}
    arrays = [
        pa.array(item, schema.field(name).type, from_pandas=True)
        if isinstance(item, np.ndarray)
        else item
        for name, item in ((name, columns[name]) for name in schema.names)
    ]
    return pa.table(arrays, schema=schema)


def _change_columns(sums: Sums, other: int) -> dict[str, Any]:
    """Returns the columns of pairs and changes from the first control to another one.

    other: number of the other control, from 1.
    """
    before, after, difference = sums.of_pairs(other)
    half_width, ratio = difference.half_width, ratio_half_widths(before, after, difference)
    columns = _by_metric("change", after.value - before.value, half_width)
    for k, name in enumerate(FIGURES):
        verdict = verdicts(
            name, before.value[:, k], after.value[:, k], half_width[:, k], ratio[:, k]
        )
        columns[f"change.{name}.verdict"] = verdict.tolist()
    return {"pairs": sums.pairs[:, other - 1], **columns}


def _by_metric(prefix: str, values: Array, half_widths: Array) -> dict[str, Any]:
    """Returns columns from arrays (points, metrics)."""
    columns: dict[str, Any] = {}
    for k, name in enumerate(FIGURES):
        columns[f"{prefix}.{name}"] = values[:, k]
        columns[f"{prefix}.{name}{HALF_WIDTH}"] = half_widths[:, k]
    return columns
