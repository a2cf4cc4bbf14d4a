"""Mistakes on the command line of studies are named before anything runs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command import Call, assert_refused

CPG = Path(__file__).resolve().parents[2] / "examples" / "controllers" / "cpg.py"


def test_an_address_that_is_no_scheduler_is_refused(call: Call) -> None:
    outcome = call("study", "friction_speed", "--scheduler", "localhost")
    assert_refused(outcome, "no scheduler answers", "got 'localhost'", "tcp://HOST:8786")


def test_an_fmu_is_no_study_file(call: Call, athena_fmu: Path) -> None:
    expected = "a ZIP file, such as an FMU"
    assert_refused(call("study", athena_fmu), expected, "give the path of a study file")


@pytest.mark.parametrize("path", ["a\0b", 5000 * "x"], ids=["nul", "long"])
def test_a_path_that_no_system_opens_is_refused(call: Call, path: str) -> None:
    code, _, err = call("study", f"{path}.toml", "-o", "o")
    assert code in (1, 2)
    assert "unexpected" not in err


def test_a_study_runs_the_users_controls_in_its_workers(call: Call, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(
        f'controls = ["kinematic", "mine={CPG}:Cpg"]\nseeds = 2\n'
        '[set]\nduration = 3\ngait.period = 0.8\n[factors]\n"control.lift" = [0.2, 0.3]\n'
    )
    words = ["--workers", "2", "--json", "-o", tmp_path / "out"]
    code, out, err = call("study", tmp_path / "plan.toml", *words)
    assert code == 0, err
    assert json.loads(out)["runs"] == 8
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert list(manifest["laws"]) == ["mine"]
