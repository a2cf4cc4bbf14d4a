"""Rows do not depend on the workers of a study: local ones, a cluster's, or ones that die."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from dask_cluster import dask_scheduler, restarting_workers
from gains import make_gains
from studies import KINEMATIC, SMALL, rows, run_quietly, study_of, watched
from study_runners import DEATHS_FILE, Buggy, Slow

from hexapod_cosim.cosim.master.loop import FAILED
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.worker_pool import TRIES
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.extensions.study.dispatch import DIED, WHY_DIED
from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.extensions.study.run import Options, run_study
from hexapod_cosim.extensions.study.store import FIGURES
from hexapod_cosim.models import load_robot

WALK: dict[str, Any] = {
    "set": {"duration": 1.2, "gait.period": 0.4},
    "factors": {"friction.mu": [0.5, 0.8], "gains.hold.path_rate": [0.1, 0.3]},
}

TIMEOUT = 120.0  # s    for what takes some seconds on an idle machine
LONG = """
controls = ["kinematic"]
seeds = 2000
"""


@pytest.fixture(scope="module")
def deaths(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The file to which engines write before they end their process."""
    file = tmp_path_factory.mktemp("deaths") / "deaths.txt"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(DEATHS_FILE, str(file))
        yield file


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory, deaths: Path) -> Iterator[str]:
    """Starts a scheduler with two workers that restart when they die; yields its address."""
    folder = tmp_path_factory.mktemp("dask")
    with dask_scheduler(folder) as (address, _), restarting_workers(address, 2, folder):
        yield address


def test_real_walks_on_a_cluster_are_those_on_this_machine_bit_for_bit(
    athena_fmu: Path, tmp_path: Path, scheduler: str
) -> None:
    options: dict[str, Any] = {"runner": Runner, "fmu": athena_fmu}
    options["gains"] = make_gains(load_robot("athena"))
    here = run_quietly(study_of(WALK), tmp_path / "here", workers=2, **options)
    assert run_quietly(study_of(WALK), tmp_path / "there", scheduler=scheduler, **options) == here
    assert all(row["walked"] for row in here)
    slips = [row["slip_per_metre"] for row in here if row["control"] == "compliant"]
    assert len(set(slips)) == 4  # the gain and the friction show


def test_a_run_of_a_study_is_the_run_by_itself(athena_fmu: Path, tmp_path: Path) -> None:
    table = {
        **WALK,
        **KINEMATIC,
        "seeds": {"first": 4, "count": 1},
        "factors": {"friction.mu": [0.5]},
    }
    (row,) = run_quietly(study_of(table), tmp_path / "out", runner=Runner, fmu=athena_fmu)
    plan = load_scenario(
        "walk_flat", overrides=["duration=1.2", "gait.period=0.4", "friction.mu=0.5", "seed=4"]
    )
    (summary,) = run_batch([plan], fmu=athena_fmu, workers=1, compiled=True)
    figures = {
        name: value if math.isfinite(value) else None
        for name, value in summary.metrics.items()
        if name in FIGURES
    }
    assert {name: row[name] for name in FIGURES} == figures


@pytest.mark.parametrize("cluster", [False, True], ids=["process", "cluster"])
def test_a_run_that_ends_its_worker_is_a_failure_with_a_reason_and_the_others_go_on(
    athena_fmu: Path, tmp_path: Path, request: pytest.FixtureRequest, deaths: Path, cluster: bool
) -> None:
    deaths.unlink(missing_ok=True)
    place = {"scheduler": request.getfixturevalue("scheduler")} if cluster else {"workers": 1}
    study = study_of({**KINEMATIC, "factors": {"friction.mu": [0.3, 0.5, 0.13, 0.6]}})
    found = run_quietly(study, tmp_path / "out", fmu=athena_fmu, **place)
    died = [row for row in found if row["status"] == DIED]
    assert [(row["friction.mu"], row["seed"]) for row in died] == [(0.13, 0)]
    assert {row["reason"] for row in died} == {WHY_DIED}
    assert sum(row["walked"] for row in found) == len(found) - 1
    assert [row["run"] for row in found] == list(range(4))
    counted = Counter(deaths.read_text().splitlines())
    assert set(counted) == {"kinematic 0"}
    # alone, and perhaps among other runs before
    assert all(number >= TRIES for number in counted.values())


def test_workers_killed_from_outside_cost_no_run(athena_fmu: Path, tmp_path: Path) -> None:
    study = study_of({**KINEMATIC, "seeds": 100, "factors": {"friction.mu": [0.3, 0.5]}})
    killed: list[int] = []

    def kill_two() -> None:
        if len(killed) < 2:
            victim = next(iter(_children() - set(killed)))
            os.kill(victim, signal.SIGKILL)
            killed.append(victim)

    run_study(
        study,
        tmp_path / "out",
        options=Options(runner=Slow, fmu=athena_fmu, workers=2),
        progress=watched(kill_two),
    )
    assert len(killed) == 2
    assert all(row["walked"] for row in rows(tmp_path / "out"))
    assert len(rows(tmp_path / "out")) == 200


def _children() -> set[int]:
    return {child.pid for child in multiprocessing.active_children() if child.pid is not None}


def test_workers_that_only_die_end_the_study(
    athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hexapod_cosim.extensions.study.dispatch.MAX_DEATHS_IN_A_ROW", 0)
    study = study_of({**KINEMATIC, "factors": {"friction.mu": [0.13]}, "seeds": 9})
    with pytest.raises(StudyError, match="each worker dies"):
        run_quietly(study, tmp_path / "out", fmu=athena_fmu, workers=1)


def test_a_worker_with_other_versions_is_refused(
    athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # in this process, not in the worker
    monkeypatch.setattr("hexapod_cosim.extensions.study.job.package_version", lambda: "9.9")
    with pytest.raises(
        StudyError, match=r"differs from the machine that sends.*hexapod-cosim 9.9, here"
    ):
        run_quietly(study_of({**SMALL, **KINEMATIC}), tmp_path, fmu=athena_fmu, workers=2)


def test_errors_in_a_run_are_results_and_the_study_continues(
    athena_fmu: Path, tmp_path: Path
) -> None:
    errors = {
        0.21: "LinAlgError: Singular matrix",
        0.23: "MemoryError: no more",
        0.24: "SourError: nobody can send <object object at 0x...>",
        0.25: "SystemExit: enough",
    }
    study = study_of({**KINEMATIC, "seeds": 1, "factors": {"friction.mu": [0.3, *errors, 0.5]}})
    options: dict[str, Any] = {"runner": Buggy, "workers": 1}
    first, *bad, last = run_quietly(study, tmp_path / "out", fmu=athena_fmu, **options)
    assert first["walked"]
    assert last["walked"]
    for row, expected in zip(bad, errors.values(), strict=True):
        assert row["status"] == FAILED
        assert row["reason"].startswith(expected)
        assert row["slip_per_metre"] is None
    assert "(study_runners.py, line" in bad[1]["reason"]
