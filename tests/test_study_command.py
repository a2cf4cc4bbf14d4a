"""`hexapod study` as it is typed."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import Call, assert_refused
from studies import FAKE, digest

KINEMATIC = 'controls = ["kinematic"]\n'


def study_file(folder: Path, text: str) -> Path:
    file = folder / "study.toml"
    file.write_text(text)
    return file


def test_it_says_when_no_run_walked_at_all(call: Call, athena_fmu: Path, tmp_path: Path) -> None:
    file = study_file(tmp_path, KINEMATIC + "seeds = 4\n[factors]\nfriction.mu = [0.17]\n")
    code, out, err = call("study", file, "-o", tmp_path / "out", "--engine", FAKE, "--fmu", athena_fmu, "--workers", "0")
    assert code == 0
    assert "4 x kinematic refused" in out
    assert err == "warning: none of 4 kinematic runs walked to its end; all refused: no walk with #\n"
    file = study_file(tmp_path, KINEMATIC + "seeds = 4\n[factors]\nfriction.mu = [0.17, 0.5]\n")
    _, _, err = call("study", file, "-o", tmp_path / "half", "--engine", FAKE, "--fmu", athena_fmu, "--workers", "0")
    assert err == ""


def test_one_fmu_for_several_robots_is_refused(call: Call, athena_fmu: Path, tmp_path: Path) -> None:
    file = study_file(tmp_path, KINEMATIC + '[factors]\nrobot = ["athena", "phantomx_mk4"]\n')
    outcome = call("study", file, "-o", tmp_path / "out", "--engine", FAKE, "--fmu", athena_fmu)
    assert_refused(outcome, "--fmu", "one FMU for several robots", "athena, phantomx_mk4", "leave --fmu out")


@pytest.mark.parametrize("workers", ["0", "1"])
def test_results_are_the_same_in_this_process_and_in_one_of_its_own(call: Call, athena_fmu: Path, tmp_path: Path, workers: str) -> None:
    file = study_file(tmp_path, KINEMATIC + "seeds = 4\n")
    code, _, _ = call("study", file, "-o", tmp_path / "out", "--engine", FAKE, "--fmu", athena_fmu, "--workers", workers)
    assert code == 0
    call("study", file, "-o", tmp_path / "two", "--engine", FAKE, "--fmu", athena_fmu, "--workers", "2")
    assert digest(tmp_path / "out") == digest(tmp_path / "two")


def test_a_number_of_workers_that_is_none_is_refused(call: Call, tmp_path: Path) -> None:
    outcome = call("study", "friction_speed", "-o", tmp_path / "out", "--workers", "-1")
    assert_refused(outcome, "--workers", "not a number of workers", "0 to 4096")
