"""Tests the store of a study, and the metadata of result files."""

from __future__ import annotations

import hashlib
import json
import os
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from command import COMMAND
from gains import make_gains
from studies import (
    KINEMATIC,
    SMALL,
    Row,
    rows,
    run_quietly,
    stored_count,
    stored_rows,
    study_of,
    watched,
    write_rows,
)
from study_runners import Counting, Slow

from hexapod_cosim.cosim.results.folder import locked
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.extensions.study import store as store_module
from hexapod_cosim.extensions.study.folder import MANIFEST, RESULTS, export_runs
from hexapod_cosim.extensions.study.reading import load_study, study_from_table
from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.extensions.study.run import Options, run_study
from hexapod_cosim.extensions.study.store import RUNS, Store
from hexapod_cosim.extensions.study.summary import read_results
from hexapod_cosim.models import HexapodError, load_robot

ROOT = Path(__file__).parents[2]
TIMEOUT = 180.0  # s    for what takes some seconds on an idle machine
MANY_RUNS: dict[str, Any] = {
    **KINEMATIC,
    "seeds": 10,
    "factors": {"friction.mu": {"linspace": [0.3, 0.9, 20]}},
}
REAL = """
controls = ["kinematic"]
seeds = 35
[set]
duration = 0.4
[factors]
friction.mu = {linspace = [0.3, 0.9, 20]}
"""
REAL_RUNS = 700


@pytest.fixture
def small(athena_fmu: Path, tmp_path: Path) -> Callable[..., list[Row]]:
    """A function that runs a small study under kinematic control into a folder of the test."""

    def run(name: str = "out", table: dict[str, Any] = SMALL, **options: Any) -> list[Row]:
        return run_quietly(
            study_of({**table, **KINEMATIC}), tmp_path / name, **{"fmu": athena_fmu, **options}
        )

    return run


def test_a_finished_study_runs_nothing_when_started_again(small: Callable[..., Any]) -> None:
    first = small()
    Counting.asked.clear()
    assert small(runner=Counting) == first
    assert not Counting.asked


def test_rows_do_not_depend_on_workers_or_chunks(small: Callable[..., Any]) -> None:
    here = small("none", MANY_RUNS, workers=0)
    assert [row["run"] for row in here] == list(range(200))
    assert small("two", MANY_RUNS, workers=2) == here


def test_rows_hold_the_settings_the_figures_and_how_a_run_ended(small: Callable[..., Any]) -> None:
    factors = {"friction.mu": [0.17, 0.19, 0.5], "gait.name": ["tripod"]}
    refused, fallen, walked = small(table={**SMALL, "seeds": 1, "factors": factors})
    assert (refused["status"], refused["reason"], refused["walked"]) == (
        "refused",
        "no walk with 0",
        False,
    )
    assert refused["slip_per_metre"] is None
    assert (fallen["status"], fallen["upright"], fallen["walked"]) == ("completed", False, False)
    settings = (walked["friction.mu"], walked["gait.name"])
    assert (*settings, walked["foot_error_stance"], walked["walked"]) == (0.5, "tripod", 1.25, True)
    assert not {"wall", "realtime_factor"} & set(walked)


def test_files_have_the_runs_in_order_and_units_in_their_columns(
    tmp_path: Path, small: Callable[..., Any]
) -> None:
    study, out = study_of({**SMALL, **KINEMATIC}), tmp_path / "out"
    small()
    write_rows(study, out, [{"run": run, "walked": True, "wall": 0.5} for run in (8, 3, 5, 4, 0)])
    with closing(Store(out, study)) as store:
        export_runs(store, out)
    assert pq.read_table(out / RESULTS)["run"].to_pylist() == [0, 3, 4, 5, 8]
    assert pq.read_table(out / RESULTS)["walked"].to_pylist() == [True] * 5
    assert pq.read_schema(out / RESULTS).field("slip_per_metre").metadata == {b"unit": b"m/m"}


def command(folder: Path, fmu: Path, *, study: Path) -> subprocess.Popen[str]:
    words = ["study", str(study), "-o", str(folder), "--fmu", str(fmu), "--workers", "2"]
    return subprocess.Popen(
        [*COMMAND, *words],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def test_real_walks_killed_at_any_point_and_completed_are_the_uninterrupted_ones(
    athena_fmu: Path, tmp_path: Path
) -> None:
    file = tmp_path / "study.toml"
    file.write_text(REAL)
    study, whole, killed = load_study(str(file)), tmp_path / "whole", tmp_path / "killed"
    process = command(killed, athena_fmu, study=file)
    deadline = time.monotonic() + TIMEOUT
    while (
        not stored_count(study, killed) and time.monotonic() < deadline and process.poll() is None
    ):
        time.sleep(0.02)
    time.sleep(random.uniform(0.0, 0.02))
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert 0 < stored_count(study, killed) < REAL_RUNS
    kept = stored_rows(study, killed)
    process = command(killed, athena_fmu, study=file)
    _, err = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, err
    numbers = {row["run"] for row in kept}
    # with their times: they were not run again
    assert [row for row in stored_rows(study, killed) if row["run"] in numbers] == kept
    assert rows(killed) == run_quietly(study, whole, fmu=athena_fmu, runner=Runner)
    assert len(rows(whole)) == REAL_RUNS
    assert all(row["status"] == "completed" for row in rows(whole))


def test_the_report_of_a_study_that_runs_has_the_runs_so_far(
    athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "FLUSH_SECONDS", 0.0)
    study, seen = study_of({**SMALL, **KINEMATIC}), list[int]()

    options = Options(fmu=athena_fmu, runner=Slow, workers=2)
    show = watched(lambda: seen.append(read_results(tmp_path).runs))
    run_study(study, tmp_path, options=options, progress=show)
    assert seen == sorted(seen)
    assert 0 < seen[0] < seen[-1] == 9


@pytest.mark.parametrize("content", [b"garbage" * 1000, b""], ids=["garbage", "empty"])
def test_a_damaged_file_of_runs_is_named_and_without_it_the_runs_are_run_again(
    small: Callable[..., Any], tmp_path: Path, content: bytes
) -> None:
    first = small()
    (tmp_path / "out" / RUNS).write_bytes(content)
    if content:  # an empty file is a database without a table
        with pytest.raises(StudyError, match=r"runs.sqlite: damaged results.*remove the file"):
            small()
        (tmp_path / "out" / RUNS).unlink()
    assert small() == first


def test_another_study_into_the_same_folder_is_refused_and_the_differences_named(
    small: Callable[..., Any], tmp_path: Path, athena_fmu: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small()
    first = (tmp_path / "out" / MANIFEST).read_bytes()
    with pytest.raises(StudyError, match=r"another study's runs.*study.seeds was 3, is 4"):
        small(table={**SMALL, "seeds": 4})
    other = tmp_path / "other.fmu"
    other.write_bytes(athena_fmu.read_bytes() + b"\0")
    with pytest.raises(StudyError, match=r"other.fmu was None, is"):
        small(fmu=other)
    monkeypatch.setattr("hexapod_cosim.extensions.study.job.code_hash", lambda: "0123456789abcdef")
    with pytest.raises(StudyError, match=r"environment.code was .*, is 0123456789abcdef"):
        small()
    assert (tmp_path / "out" / MANIFEST).read_bytes() == first


def test_a_folder_of_something_else_is_refused(small: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").touch()
    with pytest.raises(HexapodError, match=r"other files.*thesis.tex"):
        small()


def test_two_processes_do_not_share_a_folder(small: Callable[..., Any], tmp_path: Path) -> None:
    small()
    with (
        locked(tmp_path / "out"),
        pytest.raises(HexapodError, match="another process writes its results into this folder"),
    ):
        small()


def test_progress_counts_new_runs_and_those_that_did_not_walk(
    athena_fmu: Path, tmp_path: Path
) -> None:
    study = study_of({**KINEMATIC, "seeds": 2, "factors": {"friction.mu": [0.17, 0.5]}})
    counts, totals = list[tuple[int, int]](), list[int]()

    @contextmanager
    def show(total: int) -> Iterator[Any]:
        totals.append(total)
        yield lambda done, failed: counts.append((done, failed))

    options = Options(runner=Counting, workers=0, fmu=athena_fmu)
    run_study(study, tmp_path, options=options, progress=show)
    assert (counts[0], counts[-1]) == ((0, 0), (4, 2))
    run_study(study, tmp_path, options=options, progress=show)
    assert counts[-1] == (4, 0)  # nothing was left to run
    assert totals == [4, 4]


# The metadata of result files say what made them, whoever ran it.

TABLE: dict[str, Any] = {
    "title": "Größe",
    "seeds": [3, 8],
    "factors": {"friction.mu": [0.3, 0.6], "scenario": ["walk_flat", "turn"]},
}


def read_facts(path: Path) -> dict[str, str]:
    found = pq.read_metadata(path).metadata
    return {
        name.decode().removeprefix("hexapod."): text.decode()
        for name, text in found.items()
        if name.startswith(b"hexapod.")
    }


def test_a_file_by_itself_holds_the_study_its_scenarios_seeds_versions_and_gains(
    athena_fmu: Path, tmp_path: Path
) -> None:
    study, gains = study_of(TABLE), make_gains(load_robot("athena"))
    run_quietly(study, tmp_path / "out", fmu=athena_fmu, gains=gains)
    facts = read_facts(tmp_path / "out" / RESULTS)
    again = study_from_table(
        json.loads(facts["study"]),
        where="results.parquet",
        scenarios=json.loads(facts["scenarios"]),
    )
    assert (again.factors, list(again.seeds), again.controls, again.title) == (
        study.factors,
        [3, 8],
        study.controls,
        "Größe",
    )
    assert {name: case.table for name, case in again.cases.items()} == {
        name: case.table for name, case in study.cases.items()
    }
    assert (json.loads(facts["seeds"]), facts["runs"]) == ([3, 8, 2], "16")
    environment = json.loads(facts["environment"])
    assert environment["numpy"] == np.__version__
    assert environment[str(athena_fmu)] == hashlib.sha256(athena_fmu.read_bytes()).hexdigest()
    hold = asdict(gains)["hold"]
    assert json.loads(facts["gains"])["hold"] == hold
