"""Studies on a cluster: its workers and its scheduler may die, and several studies may share it."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from command import COMMAND
from dask_cluster import TIMEOUT, dask_scheduler, kill, mortal_workers, restarting_workers
from studies import KINEMATIC, Row, quiet, rows, run_quietly, study_of, watched
from study_runners import Slow

from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.extensions.study.run import Options, run_study

TABLE: dict[str, Any] = {**KINEMATIC, "seeds": 40, "factors": {"friction.mu": [0.3, 0.5]}}


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Starts a scheduler without workers; yields its address."""
    with dask_scheduler(tmp_path_factory.mktemp("dask")) as (address, _):
        yield address


@pytest.fixture
def study_on(athena_fmu: Path, tmp_path: Path, scheduler: str) -> Callable[..., None]:
    """A function that runs the study on the cluster into tmp_path/out.

    It calls its argument once, when the first results are there.
    """

    def run(after_the_first: Callable[[], object], address: str = scheduler) -> None:
        options = Options(runner=Slow, fmu=athena_fmu, scheduler=address)
        run_study(
            study_of(TABLE), tmp_path / "out", options=options, progress=once(after_the_first)
        )

    return run


def once(act: Callable[[], object]) -> Any:
    """Returns a display of progress that calls `act` once, when the first results are there."""
    todo = [act]
    return watched(lambda: todo and todo.pop()())


@pytest.fixture(scope="module")
def alone(athena_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Row]:
    """Returns the rows of the study run within this process."""
    folder = tmp_path_factory.mktemp("alone") / "out"
    return run_quietly(study_of(TABLE), folder, fmu=athena_fmu, runner=Slow)


def test_a_killed_worker_costs_no_run(
    study_on: Callable[..., Any], scheduler: str, alone: list[Row], tmp_path: Path
) -> None:
    with mortal_workers(scheduler, 2, tmp_path) as workers:
        study_on(lambda: kill(workers[0]))
    assert rows(tmp_path / "out") == alone


def test_a_scheduler_that_dies_ends_the_study_with_what_is_stored(
    study_on: Callable[..., Any], athena_fmu: Path, alone: list[Row], tmp_path: Path
) -> None:
    with (
        dask_scheduler(tmp_path) as (address, process),
        restarting_workers(address, 1, tmp_path),
        pytest.raises(StudyError, match=r"the cluster is gone.*start the study again"),
    ):
        study_on(lambda: kill(process), address)
    run_quietly(study_of(TABLE), tmp_path / "out", fmu=athena_fmu, runner=Slow)
    assert rows(tmp_path / "out") == alone


def test_ctrl_c_ends_a_study_that_waits_for_workers(
    scheduler: str, athena_fmu: Path, tmp_path: Path
) -> None:
    file = tmp_path / "study.toml"
    file.write_text('controls = ["kinematic"]\nseeds = 30\n')
    words = [*COMMAND, "study", str(file), "-o", str(tmp_path / "out"), "--fmu", str(athena_fmu)]
    with subprocess.Popen(
        [*words, "--scheduler", scheduler], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        warning = next(line for line in process.stderr if "waiting for some" in line)
        process.send_signal(signal.SIGINT)
        err = process.communicate(timeout=TIMEOUT)[1]
    assert "no workers" in warning
    assert "stopped; the runs so far are in" in err
    assert process.returncode == 130


def test_studies_that_share_a_cluster_do_not_disturb_each_other(
    athena_fmu: Path, tmp_path: Path, scheduler: str
) -> None:
    # all of them with the same FMU, scenario and factors
    tables = [TABLE, {**TABLE, "seeds": {"first": 500, "count": 20}}, TABLE]

    def run(k: int) -> None:
        options = Options(runner=Slow, fmu=athena_fmu, scheduler=scheduler)
        run_study(study_of(tables[k]), tmp_path / f"out{k}", options=options, progress=quiet)

    with mortal_workers(scheduler, 2, tmp_path), ThreadPoolExecutor(len(tables)) as together:
        list(together.map(run, range(len(tables))))
    for k, table in enumerate(tables[:2]):
        alone = run_quietly(study_of(table), tmp_path / f"alone{k}", runner=Slow, fmu=athena_fmu)
        assert rows(tmp_path / f"out{k}") == alone
    assert rows(tmp_path / "out0") == rows(tmp_path / "out2")
