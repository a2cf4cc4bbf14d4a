"""The command `hexapod study`: its output, messages and exit codes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from command import COMMAND, Call, assert_refused
from dask_cluster import HELPERS
from studies import BRIEF, FAKE, LEAKY, digest, run_quietly

from hexapod_cosim.cosim.study.reading import load_study

HERE = Path(__file__).resolve().parent
MANY = "seeds = 3000\n"  # parts of 1024 runs
KINEMATIC = 'controls = ["kinematic"]\n'
GRIP = "seeds = 2\n[set]\nfriction.mu = 0.5\n"
ONE_FACTOR = "[factors]\nfriction.mu = [0.5]\n"


def study_file(folder: Path, text: str) -> Path:
    file = folder / "study.toml"
    file.write_text(text)
    return file


def test_a_warning_says_that_no_run_walked(call: Call, athena_fmu: Path, tmp_path: Path) -> None:
    file = study_file(tmp_path, KINEMATIC + "seeds = 4\n[factors]\nfriction.mu = [0.17]\n")
    code, out, err = call(
        "study",
        file,
        "-o",
        tmp_path / "out",
        "--engine",
        FAKE,
        "--fmu",
        athena_fmu,
        "--workers",
        "0",
    )
    assert code == 0
    assert "4 x kinematic refused" in out
    assert (
        err == "warning: none of 4 kinematic runs walked to its end; all refused: no walk with #\n"
    )


def test_a_warning_and_the_report_name_walks_too_short_for_figures(
    call: Call, athena_fmu: Path, tmp_path: Path
) -> None:
    mixed = '[factors]\ngait.name = ["tripod", "ripple"]\nscenario = ["walk_flat", "turn"]\n'
    file = study_file(tmp_path, KINEMATIC + GRIP + mixed)
    words = [
        "study",
        file,
        "-o",
        tmp_path / "out",
        "--engine",
        BRIEF,
        "--fmu",
        athena_fmu,
        "--workers",
        "0",
    ]
    code, _, err = call(*words)
    assert (code, err) == (0, "")  # each scenario has walks with figures
    file = study_file(
        tmp_path, KINEMATIC + GRIP + '[factors]\nscenario = ["walk_flat", "ripple"]\n'
    )
    code, _, err = call(*words[:3], tmp_path / "short", *words[4:])
    note = "All 2 kinematic walks of ripple are too short for figures"
    assert code == 0
    assert err.startswith(f"warning: {note}")
    assert note in (tmp_path / "short" / "report.html").read_text()
    assert note in call("report", tmp_path / "short")[2]
    file = study_file(tmp_path, KINEMATIC + 'scenario = "ripple"\n' + GRIP)
    assert call(*words[:3], tmp_path / "none", *words[4:])[2].startswith(
        "warning: The walks are too short for figures"
    )


def test_a_warning_and_the_report_name_the_runs_whose_energy_balance_misses(
    call: Call, athena_fmu: Path, tmp_path: Path
) -> None:
    file = study_file(tmp_path, "seeds = 2\n" + ONE_FACTOR)
    words = ["study", file, "-o", tmp_path / "out", "--engine", LEAKY, "--fmu", athena_fmu]
    code, _, err = call(*words, "--workers", "0")
    note = "compliant: the energy balance of 2 of 2 runs misses more than 1 %, at most 12 %"
    assert code == 0
    assert err.startswith(f"warning: {note}: tighten solver.tolerance")
    assert "kinematic" not in err
    assert note in (tmp_path / "out" / "report.html").read_text()
    assert note in call("report", tmp_path / "out")[2]


def test_one_fmu_for_several_robots_is_refused(
    call: Call, athena_fmu: Path, tmp_path: Path
) -> None:
    file = study_file(tmp_path, KINEMATIC + '[factors]\nrobot = ["athena", "phantomx_mk4"]\n')
    outcome = call("study", file, "-o", tmp_path / "out", "--engine", FAKE, "--fmu", athena_fmu)
    assert_refused(
        outcome, "--fmu", "one FMU for several robots", "athena, phantomx_mk4", "leave --fmu out"
    )


def test_a_negative_number_of_workers_is_refused(call: Call, tmp_path: Path) -> None:
    outcome = call("study", "friction_speed", "-o", tmp_path / "out", "--workers", "-1")
    assert_refused(outcome, "--workers", "not a number of workers", "0 to 4096")


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """A function that mounts a file system of a size, or changes its size, if it is allowed to."""
    place = tmp_path / "disk"
    place.mkdir()

    def sized(size: str) -> Path:
        again = ["-o", f"{'remount,' if os.path.ismount(place) else ''}size={size}"]
        words = ["mount", "-t", "tmpfs", *again, "none", str(place)]
        if (
            shutil.which("mount") is None
            or subprocess.run(words, check=False, capture_output=True).returncode
        ):
            pytest.skip("no file system can be mounted here")
        return place

    yield sized
    if os.path.ismount(place):
        subprocess.run(["umount", place], check=True)


def stored_runs(folder: Path) -> int:
    return sum(
        pq.ParquetFile(path).metadata.num_rows for path in (folder / "runs").glob("*.parquet")
    )


def fake_study(tmp_path: Path, fmu: Path, out: Path) -> list[str]:
    file = study_file(tmp_path, KINEMATIC + MANY + ONE_FACTOR)
    return [
        "study",
        str(file),
        "-o",
        str(out),
        "--engine",
        FAKE,
        "--fmu",
        str(fmu),
        "--workers",
        "0",
    ]


def assert_full_disk(done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "the disk is full" in done.stderr
    assert "start the study again: it goes on" in done.stderr


def run_in(words: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        words,
        check=False,
        env={**os.environ, "PYTHONPATH": HELPERS},
        capture_output=True,
        text=True,
    )


def test_a_full_disk_stops_the_command_and_with_room_it_is_resumed(
    athena_fmu: Path, tmp_path: Path, small_disk: Callable[[str], Path], call: Call
) -> None:
    out = small_disk("150k") / "out"
    assert_full_disk(run_in([*COMMAND, *fake_study(tmp_path, athena_fmu, out)]))
    assert 0 < stored_runs(out) < 3000
    assert not list(out.rglob(".*.new"))
    small_disk("50m")
    code, _, err = call(*fake_study(tmp_path, athena_fmu, out))
    assert code == 0
    assert "resumed: " in err
    assert "walked to its end" not in err
    run_quietly(load_study(str(tmp_path / "study.toml")), tmp_path / "roomy", fmu=athena_fmu)
    assert digest(out) == digest(tmp_path / "roomy")


def test_a_disk_that_fills_up_stops_the_command_and_stored_runs_are_kept(
    athena_fmu: Path, tmp_path: Path, call: Call
) -> None:
    out = tmp_path / "out"
    words = fake_study(tmp_path, athena_fmu, out)
    assert_full_disk(run_in([sys.executable, str(HERE / "full_disk.py"), *words]))
    kept = stored_runs(out)
    assert 1024 <= kept < 3000
    code, _, err = call(*words)
    assert code == 0
    assert f"resumed: {kept} of 3000 runs" in err
    assert stored_runs(out) == 3000
