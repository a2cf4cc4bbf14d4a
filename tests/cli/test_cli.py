"""The hexapod command: content of its JSON, exit codes, and files."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import COMMAND, QUICK, Call, settings

from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.recordings import read_csv
from hexapod_cosim.cosim.results.side_by_side import read_seeds
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import Variation
from hexapod_cosim.cosim.scenario.variation import STANDARD

SHORT = ["--set", "duration=0.2"]
CYCLES = ["--set", "duration=3", "--set", "gait.period=0.8"]  # the shortest walk with figures
RUN = {
    "commands.csv",
    "metrics.json",
    "results.csv",
    "results.parquet",
    "run.json",
    "scenario.toml",
}
# of robots that turn on the spot
TWINS = {
    "slip_per_radian",
    "path_error_per_radian",
    "yaw_drift_per_radian",
    "heat_per_radian",
    "cost_per_radian",
    "electrical_cost_per_radian",
}
CONTROLS = ["kinematic", "paper", "compliant"]
SHOWN = set(METRICS) - TWINS - {"slip_net_per_metre"}
FIGURES = {"foot_forces", "slip", "feet", "posture", "path", "torques", "energy", "footfall"}


@pytest.fixture(scope="module")
def compared(
    tmp_path_factory: pytest.TempPathFactory, plant_build: Path
) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("compare") / "out"
    command = [
        *COMMAND,
        "compare",
        "walk_flat",
        "-o",
        str(folder),
        "--seeds",
        "2",
        "--json",
        *CYCLES,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return folder, json.loads(done.stdout)


def test_compare_prints_the_shape_of_the_contract(compared: tuple[Path, dict[str, Any]]) -> None:
    folder, printed = compared
    counts = ["seeds", "walked", "warnings"]
    about = ["reference", "references", "changes"]
    assert list(printed) == [*CONTROLS, *about, *counts, "report"]
    assert printed["warnings"] == []
    for control in CONTROLS:
        assert list(printed[control]) == list(METRICS)
        assert {name for name, value in printed[control].items() if value is None} == TWINS
        assert all(
            isinstance(printed[control][name], float) for name in METRICS if name not in TWINS
        )
    assert printed["references"] == {"paper": "kinematic", "compliant": "kinematic"}
    assert (printed["seeds"], printed["walked"]) == (2, dict.fromkeys(CONTROLS, 2))
    for name in METRICS:
        change = printed["changes"]["compliant"][name]
        assert change["pairs"] == (0 if name in TWINS else 2)
        if name not in TWINS:
            assert change["difference"] == pytest.approx(
                printed["compliant"][name] - printed["kinematic"][name]
            )
    assert Path(printed["report"]) == folder / "report.html"


def test_compare_keeps_the_metrics_of_all_runs_and_the_recordings_of_the_first_seed(
    compared: tuple[Path, dict[str, Any]],
) -> None:
    folder, printed = compared
    runs = read_seeds(folder / "seeds.csv")
    for control in CONTROLS:
        assert [run.seed for run in runs[control]] == [0, 1]
        stored = json.loads((folder / control / "metrics.json").read_text())
        assert {
            name: value for name, value in runs[control][0].metrics.items() if name not in TWINS
        } == {name: stored[name] for name in METRICS if name not in TWINS}
        assert all(stored[name] is None for name in TWINS)
        slips = [run.metrics["slip_per_metre"] for run in runs[control]]
        assert slips[0] != slips[1]
        assert printed[control]["slip_per_metre"] == pytest.approx(sum(slips) / 2.0)
        assert load_scenario(folder / control / "scenario.toml").variation == STANDARD


def walked(path: Path) -> tuple[str, str]:
    """Gait and stance of a run."""
    facts = json.loads((path / "run.json").read_text())["walking"]
    return facts["gait"], facts["stance"]


@pytest.mark.usefixtures("undrawn")
def test_compare_shows_all_controls_in_one_walk_and_what_gait_and_stance_give_by_themselves(
    call: Call, tmp_path: Path
) -> None:
    (tmp_path / "level.toml").write_text("duration = 0.2\n[command]\nvx = 0.08\n")
    words = ("compare", tmp_path / "level.toml", "-o", tmp_path / "out", "--seeds", "1")
    code, out, _ = call(*words)
    assert code == 0
    for control in CONTROLS:
        assert walked(tmp_path / "out" / control) == ("tripod", "own")
    table = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert table["references"] == {
        "paper": "kinematic",
        "compliant": "kinematic",
        "kinematic@chosen": "kinematic",
        "compliant@chosen": "kinematic@chosen",
    }
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for shown in (out, page):
        assert "compliant@chosen against kinematic@chosen" in shown
        assert "kinematic, paper, compliant: tripod, period 1 s" in shown
        assert "kinematic@chosen, compliant@chosen: amble, period 1.5 s" in shown


@pytest.mark.usefixtures("undrawn")
def test_compare_shows_intervals_and_keeps_the_scenarios_own_variation(
    call: Call, tmp_path: Path
) -> None:
    code, out, _ = call(
        "compare",
        "walk_flat",
        "-o",
        tmp_path,
        "--seeds",
        "2",
        *SHORT,
        "--set",
        "variation.height=2 mm",
        "--set",
        "seed=5",
    )
    assert code == 0
    assert "compliant against kinematic" in out
    assert "2 of 2" in out
    assert "2 seeds (5 to 6)" in out
    assert load_scenario(tmp_path / "scenario.toml").variation == Variation(height=0.002)


def test_compare_leaves_results_figures_report_and_the_scenario_as_run(
    compared: tuple[Path, dict[str, Any]],
) -> None:
    folder, printed = compared
    assert {path.name for path in folder.iterdir()} == {
        *CONTROLS,
        "plots",
        "metrics.json",
        "report.html",
        "run.json",
        "scenario.toml",
        "seeds.csv",
    }
    assert {path.name for path in (folder / "plots").iterdir()} == {
        f"{name}.svg" for name in FIGURES
    }
    for control in CONTROLS:
        assert {path.name for path in (folder / control).iterdir()} == RUN
        assert load_scenario(folder / control / "scenario.toml").control == control
    assert json.loads((folder / "run.json").read_text())["status"] == "completed"
    assert json.loads((folder / "metrics.json").read_text()) == {
        key: value for key, value in printed.items() if key != "report"
    }


def metric_table(folder: Path) -> str:
    return (
        (folder / "report.html")
        .read_text(encoding="utf-8")
        .partition("<h2>Metrics</h2>")[2]
        .partition("</table>")[0]
    )


def test_report_makes_figures_and_page_again(
    compared: tuple[Path, dict[str, Any]], call: Call
) -> None:
    folder, _ = compared
    before = {path.name: path.read_bytes() for path in (folder / "plots").glob("*.svg")}
    rows = metric_table(folder)
    (folder / "report.html").unlink()
    code, out, _ = call("report", folder, "--json")
    assert code == 0
    assert json.loads(out)["report"] == str(folder / "report.html")
    assert metric_table(folder) == rows
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
    enough = settings("duration=2.4", "gait.period=0.8", "outputs.plots=false")
    code, out, _ = call("simulate", "walk_flat", "-o", tmp_path / "out", *enough)
    assert code == 0
    assert all(name in out for name in SHOWN)
    assert f"wrote {tmp_path / 'out'}/" in out


def test_both_engines_walk_the_same_walk_and_leave_the_same_files(
    call: Call, tmp_path: Path
) -> None:
    """To the last digits of their controllers; each as its command says, the Python one by
    default.
    """
    found = {}
    for engine, words in (("python", []), ("compiled", ["--engine", "compiled"])):
        folder = tmp_path / engine
        code, out, _ = call(
            "simulate",
            "walk_flat",
            "--control",
            "compliant",
            *words,
            "-o",
            folder,
            "--json",
            *CYCLES,
            *settings("outputs.plots=false"),
        )
        assert code == 0
        assert (
            " --engine compiled" in json.loads((folder / "run.json").read_text())["command"]
        ) == bool(words)
        recorded = read_csv(folder / "results.csv")
        found[engine] = (
            json.loads(out)["metrics"],
            list(recorded.names),
            recorded.data,
            {path.name for path in folder.iterdir()},
        )
    (metrics, names, rows, files), (other, other_names, other_rows, other_files) = (
        found["python"],
        found["compiled"],
    )
    assert files == other_files
    assert sorted(names) == sorted(other_names)
    order = [other_names.index(name) for name in names]
    np.testing.assert_allclose(other_rows[:, order], rows, rtol=1e-6, atol=1e-6)
    for name in set(METRICS) - TWINS - {"realtime_factor"}:
        assert other[name] == pytest.approx(metrics[name], rel=1e-6, abs=1e-9), name


@pytest.mark.parametrize("what", ["robots", "scenarios", "gaits", "terrains", "laws", "servos"])
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


def test_design_writes_gains_that_simulate_takes(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # its figures are tested in tests/design/test_controller_design.py
    monkeypatch.setattr("hexapod_cosim.controller.design.plot_design", lambda *_: [])
    code, out, _ = call("design", "-o", tmp_path / "design", "--json")
    assert code == 0
    assert all(Path(file).is_file() for file in json.loads(out)["files"])
    gains = tmp_path / "design" / "gains.toml"
    code, _, err = call(
        "simulate",
        "stand",
        "--control",
        "compliant",
        "--gains",
        gains,
        "-o",
        tmp_path / "out",
        *QUICK,
    )
    assert code == 0
    assert "designed for" not in err


def test_help_names_every_command(call: Call) -> None:
    code, out, _ = call("--help")
    assert code == 0
    for command in ("export", "simulate", "compare", "design", "report", "validate", "list"):
        assert f"  {command} " in out
        assert call(command, "--help")[0] == 0
