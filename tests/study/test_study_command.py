"""Tests the command hexapod study: its output, messages, mistakes and exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command import Call, assert_refused
from studies import stored_count, use_runner
from study_runners import Brief, Fake, Leaky

from hexapod_cosim.extensions.study import store as store_module
from hexapod_cosim.extensions.study.reading import load_study

KINEMATIC = 'controls = ["kinematic"]\n'
GRIP = "seeds = 2\n[set]\nfriction.mu = 0.5\n"
ONE_FACTOR = "[factors]\nfriction.mu = [0.5]\n"


@pytest.fixture(autouse=True)
def _fake_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    use_runner(monkeypatch, Fake)


def study_file(folder: Path, text: str) -> Path:
    file = folder / "study.toml"
    file.write_text(text)
    return file


def test_a_warning_says_that_no_run_walked(call: Call, athena_fmu: Path, tmp_path: Path) -> None:
    file = study_file(tmp_path, KINEMATIC + "seeds = 4\n[factors]\nfriction.mu = [0.17]\n")
    code, out, err = call(
        "study", file, "-o", tmp_path / "out", "--fmu", athena_fmu, "--workers", "0"
    )
    assert code == 0
    assert "4 x kinematic refused" in out
    assert (
        err == "warning: none of 4 kinematic runs walked to its end; all refused: no walk with #\n"
    )


def test_a_warning_and_the_report_name_walks_too_short_for_figures(
    call: Call, athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use_runner(monkeypatch, Brief)
    text = KINEMATIC + GRIP + '[factors]\nscenario = ["ripple"]\n'
    file, out = study_file(tmp_path, text), tmp_path / "out"
    code, _, err = call("study", file, "-o", out, "--fmu", athena_fmu, "--workers", "0")
    note = "All 2 kinematic walks are too short for figures"
    assert code == 0
    assert err.startswith(f"warning: {note}")
    assert note in (out / "report.html").read_text()


def test_a_warning_and_the_report_name_the_runs_whose_energy_balance_misses(
    call: Call, athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    use_runner(monkeypatch, Leaky)
    file = study_file(tmp_path, "seeds = 2\n" + ONE_FACTOR)
    words = ["study", file, "-o", tmp_path / "out", "--fmu", athena_fmu]
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
    outcome = call("study", file, "-o", tmp_path / "out", "--fmu", athena_fmu)
    assert_refused(
        outcome, "--fmu", "one FMU for several robots", "athena, phantomx_mk4", "leave --fmu out"
    )


def test_a_full_disk_stops_the_command_and_with_room_it_is_resumed(
    call: Call, athena_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, out = study_file(tmp_path, KINEMATIC + "seeds = 2000\n" + ONE_FACTOR), tmp_path / "out"
    words = ["study", file, "-o", out, "--fmu", athena_fmu, "--workers", "0"]
    open_store = store_module.Store.__init__

    def small(self: Any, *arguments: Any) -> None:
        open_store(self, *arguments)
        self.database.execute("PRAGMA max_page_count = 150")

    with monkeypatch.context() as patch:
        patch.setattr(store_module.Store, "__init__", small)
        code, printed, err = call(*words)
    assert (code, printed, err.count("\n")) == (1, "", 1)
    assert "the disk is full" in err
    assert "start the study again: it goes on" in err
    kept = stored_count(load_study(str(file)), out)
    assert 0 < kept < 2000  # how many a page has depends on when rows were written
    code, _, err = call(*words)
    assert code == 0
    assert f"resumed: {kept} of 2000 runs" in err


def test_only_falls_have_an_exit_code_of_their_own(
    call: Call, athena_fmu: Path, tmp_path: Path
) -> None:
    for mu, expected in ((0.19, 3), (0.17, 0), (0.5, 0)):  # falls, is refused, walks
        file = study_file(tmp_path, KINEMATIC + f"[factors]\nfriction.mu = [{mu}]\n")
        out = tmp_path / str(mu)
        words = ["-o", out, "--fmu", athena_fmu, "--workers", "0", "--json"]
        assert call("study", file, *words)[0] == expected


# Mistakes on the command line of studies are named before anything runs.

CPG = Path(__file__).resolve().parents[2] / "examples" / "controllers" / "cpg.py"


def test_an_address_that_is_no_scheduler_is_refused(call: Call, tmp_path: Path) -> None:
    outcome = call("study", "friction_speed", "--scheduler", "localhost", "-o", tmp_path / "out")
    assert_refused(outcome, "no scheduler answers", "got 'localhost'", "tcp://HOST:8786")


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
    assert str(CPG) in manifest["environment"]
