"""The hexapod command: shapes of its JSON, exit codes, what it writes, and one paragraph for every mistake."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexapod_cosim.cosim.cli import main
from hexapod_cosim.cosim.export import export_fmu
from hexapod_cosim.cosim.metrics import METRICS
from hexapod_cosim.cosim.recorder import read_csv
from hexapod_cosim.cosim.scenario import load_scenario
from hexapod_cosim.cosim.validation import find_own_problems
from hexapod_cosim.models import load_robot

COMMAND = [sys.executable, "-m", "hexapod_cosim.cosim.cli"]
CYCLES = ["--set", "duration=3", "--set", "gait.period=0.8"]  # the shortest walk with figures
QUICK = ["--set", "duration=0.2", "--set", "outputs.plots=false"]
# an explicit method of fixed step without error control has nowhere to go under an endless force
REFUSED = ["solver.method=rk4", "solver.step=0.005", "events=[{time=0.1, duration=0.1, force=[1e200, 0, 0]}]"]
FIGURES = {"foot_forces", "slip", "posture", "path", "torques", "energy", "footfall"}

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str], plant_build: Path) -> Call:
    """Runs the command in this process: exit code, stdout, stderr."""

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        streams = capsys.readouterr()
        return code, streams.out, streams.err

    return run


def settings(*pairs: str) -> list[str]:
    return [word for pair in pairs for word in ("--set", pair)]


def assert_refused(outcome: tuple[int, str, str], *parts: str) -> None:
    """Exit code not 0, nothing on stdout, one paragraph without a traceback on stderr that holds the parts."""
    code, out, err = outcome
    assert code not in (0, None)
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("hexapod: ")
    assert "Traceback" not in err
    for part in parts:
        assert part in err


# ----------------------------------------------------------------------------------------------- what works


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory, plant_build: Path) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("compare") / "out"
    command = [*COMMAND, "compare", "walk_flat", "-o", str(folder), "--json", *CYCLES]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return folder, json.loads(done.stdout)


def test_compare_prints_the_shape_of_the_contract(compared: tuple[Path, dict[str, Any]]) -> None:
    folder, printed = compared
    assert list(printed) == ["kinematic", "compliant", "report"]
    for control in ("kinematic", "compliant"):
        assert list(printed[control]) == list(METRICS)
        assert all(isinstance(value, float) for value in printed[control].values())
    assert Path(printed["report"]) == folder / "report.html"


def test_compare_leaves_results_figures_report_and_the_scenario_as_run(compared: tuple[Path, dict[str, Any]]) -> None:
    folder, printed = compared
    assert {path.name for path in folder.iterdir()} == {
        "kinematic", "compliant", "plots", "metrics.json", "report.html", "run.json", "scenario.toml",
    }  # fmt: skip
    assert {path.name for path in (folder / "plots").iterdir()} == {f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")}
    for control in ("kinematic", "compliant"):
        assert {path.name for path in (folder / control).iterdir()} == {"metrics.json", "results.csv", "run.json", "scenario.toml"}
        assert json.loads((folder / control / "metrics.json").read_text()) == printed[control]
        assert load_scenario(folder / control / "scenario.toml").control == control
    assert json.loads((folder / "run.json").read_text())["status"] == "completed"


def test_the_report_needs_no_other_file(compared: tuple[Path, dict[str, Any]]) -> None:
    page = (compared[0] / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/svg+xml;base64,") == len(FIGURES)
    assert "http" not in page.replace("http-equiv", "")
    assert all(f"<code>{name}</code>" in page for name in METRICS)
    assert "sha256" in page


def test_report_makes_figures_and_page_again(compared: tuple[Path, dict[str, Any]], call: Call) -> None:
    folder, _ = compared
    before = {path.name: path.read_bytes() for path in (folder / "plots").glob("*.svg")}
    (folder / "report.html").unlink()
    code, out, _ = call("report", folder, "--json")
    assert code == 0
    assert json.loads(out)["report"] == str(folder / "report.html")
    assert (folder / "report.html").is_file()
    assert {path.name: path.read_bytes() for path in (folder / "plots").glob("*.svg")} == before


def test_simulate_prints_metrics_and_what_it_wrote(call: Call, tmp_path: Path) -> None:
    code, out, _ = call("simulate", "walk_flat", "-o", tmp_path / "out", "--json", *QUICK)
    printed = json.loads(out)
    assert code == 0
    assert list(printed["metrics"]) == list(METRICS)
    assert printed["status"] == "completed"
    assert printed["walk"]["upright"] is True
    assert all(Path(file).is_file() for file in printed["files"])
    recording = read_csv(tmp_path / "out" / "results.csv")
    np.testing.assert_allclose(recording.time, 0.005 * np.arange(41), atol=1e-15)


def test_simulate_without_json_prints_a_table_and_the_files(call: Call, tmp_path: Path) -> None:
    code, out, _ = call("simulate", "stand", "-o", tmp_path / "out", *QUICK)
    assert code == 0
    assert all(name in out for name in METRICS)
    assert f"wrote {tmp_path / 'out'}/" in out


def test_columns_of_the_csv_can_be_chosen(call: Call, tmp_path: Path) -> None:
    code, _, _ = call("simulate", "stand", "-o", tmp_path / "out", *QUICK, "--set", "outputs.csv=['torso.roll', '*.contact']")
    assert code == 0
    names = read_csv(tmp_path / "out" / "results.csv").names
    assert names == ("time", "torso.roll", *(f"{leg}.foot.contact" for leg in ("LF", "LM", "LR", "RF", "RM", "RR")))


def test_a_folder_of_an_earlier_run_is_written_anew(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert call("simulate", "stand", "-o", folder, "--set", "duration=0.2")[0] == 0
    assert (folder / "report.html").is_file()
    assert call("simulate", "stand", "-o", folder, *QUICK)[0] == 0
    assert {path.name for path in folder.iterdir()} == {"metrics.json", "results.csv", "run.json", "scenario.toml"}


@pytest.mark.parametrize("what", ["robots", "scenarios", "gaits", "terrains", "laws"])
def test_list_names_what_there_is(call: Call, what: str) -> None:
    code, out, _ = call("list", what, "--json")
    rows = json.loads(out)
    assert code == 0
    assert rows
    code, table, _ = call("list", what)
    assert code == 0
    assert all(row["name"] in table for row in rows)


def test_export_makes_an_fmu_that_validate_accepts(call: Call, tmp_path: Path) -> None:
    path = tmp_path / "phantomx.fmu"
    code, out, _ = call("export", "--robot", "phantomx_mk4", "-o", path)
    assert (code, out) == (0, f"wrote {path}\n")
    code, out, _ = call("validate", path, "--json")
    assert code == 0
    assert json.loads(out) == {"fmu": str(path), "valid": True, "problems": []}


def test_design_writes_gains_that_simulate_takes(call: Call, tmp_path: Path) -> None:
    code, out, _ = call("design", "-o", tmp_path / "design", "--json")
    assert code == 0
    assert all(Path(file).is_file() for file in json.loads(out)["files"])
    gains = tmp_path / "design" / "gains.toml"
    code, _, err = call("simulate", "stand", "--control", "compliant", "--gains", gains, "-o", tmp_path / "out", *QUICK)
    assert code == 0
    assert "designed for" not in err
    code, _, err = call("simulate", "phantomx_walk", "--control", "compliant", "--gains", gains, "-o", tmp_path / "out", *QUICK)
    assert code == 0
    assert "warning: compliant: the gains were designed for robot 'athena'" in err


def test_help_names_every_command(call: Call) -> None:
    code, out, _ = call("--help")
    assert code == 0
    for command in ("export", "simulate", "compare", "design", "report", "validate", "list"):
        assert f"  {command} " in out
        assert call(command, "--help")[0] == 0


# ------------------------------------------------------------------------------------------- what does not


def test_a_run_that_ends_early_keeps_what_was_recorded_under_another_name(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert call("simulate", "walk_flat", "-o", folder, *QUICK)[0] == 0
    code, out, err = call("simulate", "walk_flat", "-o", folder, *QUICK, *settings(*REFUSED))
    assert (code, out) == (1, "")
    assert "the run ended at 0.100 s of 0.2 s" in err
    assert "not finite" in err
    assert "Traceback" not in err
    assert {path.name for path in folder.iterdir()} == {"results.partial.csv", "run.json", "scenario.toml"}
    assert read_csv(folder / "results.partial.csv").time[-1] == pytest.approx(0.1)
    assert json.loads((folder / "run.json").read_text())["status"] == "failed"
    assert_refused(call("report", folder), "the run did not complete")


def test_a_comparison_that_ends_early_says_so_in_both_folders(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert call("compare", "walk_flat", "-o", folder, *QUICK, *settings(*REFUSED))[0] == 1
    assert {path.name for path in folder.iterdir()} == {"kinematic", "run.json"}
    assert {path.name for path in (folder / "kinematic").iterdir()} == {"results.partial.csv", "run.json", "scenario.toml"}
    assert all(json.loads((place / "run.json").read_text())["status"] == "failed" for place in (folder, folder / "kinematic"))


def test_ctrl_c_keeps_what_was_recorded_under_another_name(plant_build: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    command = [*COMMAND, "simulate", "walk_flat", "-o", str(folder), "--set", "duration=300", "--set", "outputs.csv=['torso.*']"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        deadline = time.monotonic() + 60.0
        while not (folder / "run.json").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(3.0)  # into the loop
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=120.0)
    finally:
        process.kill()
    assert process.returncode == 130
    assert out == ""
    assert "Traceback" not in err
    assert {path.name for path in folder.iterdir()} == {"results.partial.csv", "run.json", "scenario.toml"}
    recording = read_csv(folder / "results.partial.csv")
    np.testing.assert_allclose(recording.time, 0.005 * np.arange(len(recording.time)), atol=1e-9)
    assert json.loads((folder / "run.json").read_text())["status"] == "interrupted"


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["simulate", "walk_flt"], ["unknown scenario", "did you mean 'walk_flat'"]),
        (["simulate", "--set", "gait.periode=1"], ["walk_flat.toml", "'periode'", "did you mean 'period'"]),
        (["simulate", "--set", "macro_step=0"], ["macro_step", "got 0", "> 0"]),
        (["simulate", "--set", "macro_step=-0.005"], ["macro_step", "got -0.005", "> 0"]),
        (["simulate", "--control", "complaint"], ["'complaint'", "did you mean 'compliant'"]),
        (["simulate", "--set", "torso.mas=3"], ["'torso.mas'", "did you mean 'torso.mass'"]),
        (["simulate", "--set", "torso.mass=-3"], ["torso.mass", "-3"]),
        (["simulate", "--set", "robot=atena"], ["unknown robot", "did you mean 'athena'"]),
        (["simulate", "--set", "gait.period=0.005"], ["period"]),
        (["simulate", "--set", "outputs.csv=['torso.rol']"], ["outputs.csv", "did you mean 'torso.roll'"]),
        (["simulate", "--set", "friction.mu=-1"], ["friction.mu", "got -1"]),
        (["simulate", "--gains", "missing.toml"], ["cannot read the gains", "missing.toml"]),
        (["simulate", "--fmu", "missing.fmu"], ["no such FMU", "missing.fmu", "hexapod export"]),
        (["compare", "walk_flt"], ["unknown scenario"]),
        (["report", "."], ["not a results folder"]),
        (["validate", "missing.fmu"], ["no such FMU"]),
        (["export", "--robot", "atena"], ["unknown robot", "did you mean 'athena'"]),
        (["export", "-o", "athena.zip"], [".fmu"]),
        (["export", "--fmi", "7"], ["FMI version", "got 7"]),
        (["export", "--platforms", "amiga"], ["amiga"]),
        (["design", "--robot", "atena"], ["unknown robot"]),
        (["design", "--macro-step", "-1"], ["period", "got -1"]),
        (["list", "robot"], ["'robot'", "did you mean 'robots'"]),
    ],
)
def test_a_mistake_gets_one_clear_paragraph(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], parts: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert_refused(call(*arguments), *parts)
    assert not list(tmp_path.rglob("results*"))
    assert not list(tmp_path.rglob("*.fmu"))


def test_an_unwritable_place_is_refused_before_the_run(call: Call, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    assert_refused(call("simulate", "-o", tmp_path / "file" / "out"), "cannot write", "-o")
    assert_refused(call("simulate", "-o", tmp_path / "file"), "cannot write")
    assert_refused(call("design", "-o", tmp_path / "file"), "cannot write")
    assert_refused(call("export", "-o", tmp_path / "file" / "a.fmu"), "cannot write")


def test_a_folder_of_someone_elses_files_is_left_alone(call: Call, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    assert_refused(call("compare", "-o", tmp_path), "the folder holds other files", "thesis.tex")
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_foreign_fmu_is_refused(call: Call, tmp_path: Path, athena_fmu: Path) -> None:
    arguments = ["simulate", "phantomx_walk", "--fmu", athena_fmu, "-o", tmp_path / "out"]
    assert_refused(call(*arguments), "the FMU holds another robot: torso.mass", "got 2.6", "hexapod export")
    (tmp_path / "plain.fmu").write_text("no archive")
    assert_refused(call("simulate", "--fmu", tmp_path / "plain.fmu", "-o", tmp_path / "out"), "not an FMU", "plain.fmu")


def tampered(source: Path, target: Path, member: str, change: Callable[[bytes], bytes]) -> Path:
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            new.writestr(name, change(old.read(name)) if name == member else old.read(name))
    return target


@pytest.mark.parametrize(
    ("member", "change", "part"),
    [
        ("resources/start_values.txt", lambda text: b"{wrong}" + text[text.index(b"\n") :], "has GUID"),
        ("resources/start_values.txt", lambda text: text.replace(b" torso.mass", b"p1 torso.mass"), "torso.mass"),
        ("resources/start_values.txt", lambda text: text + b"99999 1.0\n", "99999"),
        ("resources/start_values.txt", lambda text: text + b"nonsense\n", "'nonsense'"),
        ("binaries/linux64/hexapod.so", lambda _: b"no library", "cannot be loaded"),
    ],
)
def test_what_no_general_checker_sees_is_found(
    plant_build: Path, tmp_path: Path, member: str, change: Callable[[bytes], bytes], part: str
) -> None:
    good = export_fmu(load_robot("athena"), tmp_path / "good.fmu")
    assert find_own_problems(good) == []
    problems = find_own_problems(tampered(good, tmp_path / "bad.fmu", member, change))
    assert any(part in problem for problem in problems)


def test_validate_says_what_is_wrong(call: Call, tmp_path: Path, plant_build: Path) -> None:
    good = export_fmu(load_robot("athena"), tmp_path / "good.fmu")
    bad = tampered(good, tmp_path / "bad.fmu", "modelDescription.xml", lambda text: text.replace(b'"output"', b'"outputs"', 1))
    code, out, err = call("validate", bad, "--json")
    printed = json.loads(out)
    assert code == 1
    assert printed["valid"] is False
    assert any("outputs" in problem for problem in printed["problems"])
    assert "the FMU is not sound" in err


def test_an_unknown_option_is_told_and_not_zero(call: Call) -> None:
    code, out, err = call("simulate", "--speed", "3")
    assert (code, out) == (2, "")
    assert "No such option: --speed" in err


def test_an_unexpected_error_is_one_line_with_a_hint(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    def burst(*_: object, **__: object) -> None:
        raise ZeroDivisionError("by nought")

    monkeypatch.setattr("hexapod_cosim.cosim.cli.run_commands.load_scenario", burst)
    assert_refused(call("simulate"), "unexpected ZeroDivisionError: by nought", "--debug")
    with pytest.raises(ZeroDivisionError):
        main(["--debug", "simulate"])
