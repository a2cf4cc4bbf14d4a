"""A study's folder read again: its runs so far, points, totals; points.parquet and summary.json."""

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
from hexapod_cosim.cosim.study.store.sums import (
    AFTER,
    BEFORE,
    DIFFERENCE,
    Block,
    Rows,
    blocks_of,
    whole_pairs,
)
from hexapod_cosim.cosim.study.store.table import Mean, Overall, Point, Tally, point_at
from hexapod_cosim.cosim.study.store.trials import OPTIMUM, Trial, trials_of
from hexapod_cosim.models import HexapodError

POINTS, SUMMARY = "points.parquet", "summary.json"
HALF = ".half_width"  # of a 95 % interval
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
    damaged: list[str]  # parts that could not be read, in words
    wall: float  # s    elapsed, added up over all runs, whatever ran beside them


def stored_study(folder: Path) -> tuple[Study, dict[str, Any]]:
    """The study of a folder and its manifest. Raises HexapodError when there is none."""
    try:
        manifest: dict[str, Any] = read_json(folder / MANIFEST)
    except HexapodError as error:
        fix = "give a folder written by `hexapod study`"
        raise HexapodError(
            "not a study's folder", got=str(folder), expected=f"a folder with {MANIFEST}", fix=fix
        ) from error
    where = str(folder / MANIFEST)
    study = study_from_table(manifest["study"], where=where, scenarios=manifest["scenarios"])
    return replace(
        study, title=manifest["title"]
    ), manifest  # which is the file's name where the file has none


def read_results(folder: Path) -> Results:
    """Reads all runs once. Writes points.parquet and summary.json. Raises HexapodError."""
    study, manifest = stored_study(folder)
    facts = read_json(folder / RUN_FILE)
    tables, damaged = _tables(folder, study, finished=facts["status"] == COMPLETED)
    tally, kept, count = Tally(study), list[Point](), 0
    wall = 0.0

    def watched() -> Iterator[Rows]:
        nonlocal wall
        for table in whole_pairs(tables, study.run_controls):
            wall += pc.sum(table[WALL]).as_py() or 0.0
            rows = Rows(table, study)
            tally.add(rows)
            yield rows

    def chosen() -> Iterator[pa.Table]:
        nonlocal count
        for block in blocks_of(watched()):
            places = np.flatnonzero(block.first["point"].to_numpy() % step == 0).tolist()
            kept.extend(point_at(block, place, study) for place in places)
            count += len(block.held_out)
            yield points_table(block, study)

    step = (
        max(
            math.ceil(
                manifest["runs"] / (len(study.seeds) * len(study.run_controls)) / MOST_POINTS
            ),
            1,
        )
        if study.optimise is None
        else 1
    )
    write_whole(folder / POINTS, chosen(), points_schema(study).with_metadata(provenance(manifest)))
    trials = [] if study.optimise is None else trials_of(Optimisation(study), kept)
    optimum = read_json(folder / OPTIMUM) if (folder / OPTIMUM).exists() else None
    results = Results(
        study=study,
        manifest=manifest,
        facts=facts,
        overall=tally.overall(),
        points=kept,
        of_points=count,
        trials=trials,
        optimum=optimum,
        damaged=damaged,
        wall=wall,
    )
    write_durably(folder / SUMMARY, (to_json(summary_of(results)) + "\n").encode())
    return results


def _tables(folder: Path, study: Study, *, finished: bool) -> tuple[Iterator[pa.Table], list[str]]:
    """All runs in order from their parts, which have checksums; where one is damaged, from a
    finished study's results or from the others.

    And in words, which parts are missing.
    """
    store = Store(folder / RUNS, schema_of(study))
    damaged = store.skip_damaged()
    whole = _readable(folder, study) if finished and (damaged or not store.parts()) else None
    return (store.sorted_rows(), damaged) if whole is None else (_blocks(*whole), [])


def _readable(folder: Path, study: Study) -> tuple[pq.ParquetFile, pq.ParquetFile] | None:
    """The results and times of a finished study, if they are there and whole as far as their
    ends tell.
    """
    try:
        files = pq.ParquetFile(folder / RESULTS), pq.ParquetFile(folder / TIMES)
    except (OSError, pa.ArrowException):
        return None
    known = files[0].schema_arrow.names == result_schema(schema_of(study)).names
    return files if known and files[0].metadata.num_rows == files[1].metadata.num_rows else None


def _blocks(results: pq.ParquetFile, times: pq.ParquetFile) -> Iterator[pa.Table]:
    """Runs with what they took, some ten thousand at a time."""
    try:
        for runs, took in zip(
            results.iter_batches(ROWS_AT_ONCE), times.iter_batches(ROWS_AT_ONCE), strict=True
        ):
            yield pa.Table.from_batches([runs]).append_column(WALL, took[WALL])
    except (OSError, pa.ArrowException) as error:
        fix = "start the study again: it runs what is missing and writes them anew"
        raise HexapodError(
            "damaged results",
            got=str(error),
            expected=f"{RESULTS} and {TIMES} as they were written",
            fix=fix,
        ) from error


def summary_of(results: Results) -> dict[str, Any]:
    """For JSON: totals, means with half their interval, changes, failures by reason, the
    optimum.
    """
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
        "pairs": overall.pairs,
        "means": {
            control: {name: _mean(item) for name, item in means.items()}
            for control, means in overall.means.items()
        },
        "change": {name: change.as_table() for name, change in overall.changes.items()},
        "failures": failures,
        "optimum": results.optimum,
    }


def _mean(item: Mean) -> dict[str, float]:
    return {"mean": item.value, "half_width": item.half_width, "runs": item.runs}


def points_schema(study: Study) -> pa.Schema:
    """A point's settings, then by control runs, walked and each metric's mean with half its
    interval, then pairs and their changes.
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
            for part in ("", HALF)
        ]
    if len(study.run_controls) == 2:
        fields.append(pa.field("pairs", pa.int64()))
        fields += [
            runs.field(name).with_name(f"change.{name}{part}")
            for name in FIGURES
            for part in ("", HALF)
        ]
        fields += [pa.field(f"change.{name}.verdict", pa.string()) for name in FIGURES]
    return pa.schema(fields)


def points_table(block: Block, study: Study) -> pa.Table:
    """A block's points as rows of points.parquet."""
    sums, schema = block.sums, points_schema(study)
    columns: dict[str, Any] = {
        name: block.first[name] for name in schema.names if name in block.first.schema.names
    }
    columns["held_out"] = block.held_out
    for k, control in enumerate(study.run_controls):
        columns |= {f"{control}.runs": sums.runs[:, k], f"{control}.walked": sums.walked[:, k]}
        part = sums.moments[:, k]
        columns |= _by_metric(control, part.value, part.half_width)
    if len(study.run_controls) == 2:
        before, after, half_width = (sums.moments[:, part] for part in (BEFORE, AFTER, DIFFERENCE))
        ratio = ratio_half_widths(before, after, half_width)
        columns |= {
            "pairs": sums.pairs,
            **_by_metric("change", after.value - before.value, half_width.half_width),
        }
        for k, name in enumerate(FIGURES):
            verdict = verdicts(
                name,
                before.value[:, k],
                after.value[:, k],
                half_width.half_width[:, k],
                ratio[:, k],
            )
            columns[f"change.{name}.verdict"] = verdict.tolist()
    arrays = [
        pa.array(item, schema.field(name).type, from_pandas=True)
        if isinstance(item, np.ndarray)
        else item
        for name, item in ((name, columns[name]) for name in schema.names)
    ]
    return pa.table(arrays, schema=schema)


def _by_metric(what: str, values: Array, half_widths: Array) -> dict[str, Any]:
    """(g, figures) as columns."""
    found: dict[str, Any] = {}
    for k, name in enumerate(FIGURES):
        found |= {f"{what}.{name}": values[:, k], f"{what}.{name}{HALF}": half_widths[:, k]}
    return found
