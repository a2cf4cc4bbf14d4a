"""Runs of the hexapod command that do not complete keep their recordings under another name."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Generator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import COMMAND, QUICK, Call, assert_refused, settings

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.recordings import read_csv, write_commands
from hexapod_cosim.cosim.results.summary import Summary, refused_summary
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import HexapodError

PARTIAL = {"results.partial.csv", "results.partial.parquet", "run.json", "scenario.toml"}
# an explicit method of fixed step without error control has nowhere to go under an endless force
REFUSED = [
    "solver.method=dp54",
    "solver.step=0.002",
    "events=[{time=0.1, duration=0.1, force=[1e8, 1e8, 1e8], torque=[1e8, 1e8, 1e8]}]",
]


def test_a_run_that_ends_early_keeps_what_was_recorded_under_another_name(
    call: Call, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    assert call("simulate", "walk_flat", "-o", folder, *QUICK)[0] == 0
    code, out, err = call("simulate", "walk_flat", "-o", folder, *QUICK, *settings(*REFUSED))
    assert (code, out) == (1, "")
    ended = re.search(r"the run ended at (0\.1\d\d) s of 0\.2 s", err)
    assert ended
    assert "not finite" in err
    assert "Traceback" not in err
    assert {path.name for path in folder.iterdir()} == PARTIAL
    assert read_csv(folder / "results.partial.csv").time[-1] == pytest.approx(float(ended[1]))
    assert json.loads((folder / "run.json").read_text())["status"] == "failed"
    assert_refused(
        call("report", folder),
        "the run did not complete",
        "what was recorded until then is in results.partial.csv and results.partial.parquet",
    )
    (folder / "run.json").write_text('{"status": "running"}', encoding="utf-8")
    assert_refused(call("report", folder), "it goes on, or its process was killed")


def test_a_comparison_that_ends_early_says_so_in_both_folders(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert call("compare", "walk_flat", "-o", folder, *QUICK, *settings(*REFUSED))[0] == 1
    assert {path.name for path in folder.iterdir()} == {"kinematic", "run.json"}
    assert {path.name for path in (folder / "kinematic").iterdir()} == PARTIAL
    assert all(
        json.loads((place / "run.json").read_text())["status"] == "failed"
        for place in (folder, folder / "kinematic")
    )


# a control that stands still and tells when 20 macro-steps are over
STILL = """
from pathlib import Path

class Still:
    angle = None

    def step(self, t, command, measurement):
        if self.angle is None:
            self.angle = measurement.angle.copy()
        if t >= 0.1:
            Path(__file__).with_name("began").touch()
        return self.angle
"""


def test_ctrl_c_keeps_what_was_recorded_under_another_name(
    plant_build: Path, tmp_path: Path
) -> None:
    folder, law = tmp_path / "out", tmp_path / "law.py"
    law.write_text(STILL)
    command = [
        *COMMAND,
        "simulate",
        "walk_flat",
        "-o",
        str(folder),
        "--set",
        "duration=900",
        "--set",
        "outputs.csv=['torso.*']",
        "--set",
        f"control={law}:Still",
    ]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        deadline = time.monotonic() + 180.0
        while not (tmp_path / "began").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=180.0)
    finally:
        process.kill()
    assert process.returncode == 130
    assert out == ""
    assert "Traceback" not in err
    assert {path.name for path in folder.iterdir()} == PARTIAL
    recording = read_csv(folder / "results.partial.csv")
    np.testing.assert_allclose(recording.time, 0.005 * np.arange(len(recording.time)), atol=1e-9)
    assert json.loads((folder / "run.json").read_text())["status"] == "interrupted"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_while_results_are_written_waits_for_them(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    def struck(recording: Recording, path: Path) -> None:
        signal.raise_signal(number)
        write_commands(recording, path)

    monkeypatch.setattr("hexapod_cosim.cosim.results.folder.write_commands", struck)
    folder = tmp_path / "out"
    code, out, err = call("simulate", "stand", "-o", folder, *QUICK)
    assert (code, out) == (130, "")
    assert "hexapod: interrupted" in err
    assert len(read_csv(folder / "results.csv").time) == 41
    assert json.loads((folder / "run.json").read_text())["status"] == "completed"


def test_a_refused_run_leaves_the_earlier_results(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert call("simulate", "stand", "-o", folder, *QUICK)[0] == 0
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert call("simulate", "stand", "-o", folder, *QUICK, *settings("torso.mass=0"))[0] == 1
    assert call("simulate", "stand", "-o", folder, *QUICK, "--fmu", "nope.fmu")[0] == 1
    assert call("compare", "walk_flat", "-o", folder, *QUICK, *settings("torso.mass=0"))[0] == 1
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    assert call("simulate", "-o", tmp_path / "new" / "place", "--fmu", "nope.fmu")[0] == 1
    assert not (tmp_path / "new").exists()


def test_a_torso_that_sinks_has_fallen(call: Call, tmp_path: Path) -> None:
    arguments = [
        "simulate",
        "stand",
        "-o",
        tmp_path / "out",
        "--json",
        *settings("servo.mode=torque", "duration=2", "outputs.plots=false"),
    ]
    code, out, err = call(*arguments)
    assert code == 3  # falls have an exit code of their own
    assert "warning: kinematic: the robot fell at" in err
    assert json.loads(out)["walk"]["upright"] is False
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "completed"
    assert {"metrics.json", "results.parquet"} <= {
        path.name for path in (tmp_path / "out").iterdir()
    }


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("upright", "code"), [((True, True), 0), ((True, False), 3)])
def test_a_fall_under_either_control_ends_a_comparison_with_the_code_of_falls(
    call: Call,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    upright: tuple[bool, bool],
    code: int,
) -> None:
    def others(scenarios: Sequence[Scenario], **_: object) -> Generator[Summary, None, None]:
        for scenario in scenarios:
            stands = upright["compliant" in scenario.control]
            yield replace(
                refused_summary(scenario, HexapodError("")),
                status="completed",
                upright=stands,
                warnings=() if stands else ("it fell",),
            )

    monkeypatch.setattr("hexapod_cosim.cosim.cli.runs.run_batch", others)
    returned, out, _ = call(
        "compare",
        "stand",
        *("--control", "kinematic", "--control", "compliant"),
        "-o",
        tmp_path / "out",
        "--seeds",
        "2",
        "--json",
        "--set",
        "duration=0.2",
    )
    assert returned == code
    assert json.loads(out)["walked"] == {"kinematic": 1 + upright[0], "compliant": 1 + upright[1]}
    assert (tmp_path / "out" / "report.html").is_file()
