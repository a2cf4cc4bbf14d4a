"""A pattern generator, a pythonfmu controller and ours side by side, under labels of any text."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from command import COMMAND, QUICK, Call, assert_refused

from hexapod_cosim.cosim.results.side_by_side import read_seeds

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
CPG = f"{EXAMPLES / 'controllers' / 'cpg.py'}:Cpg"
SWAY = f"sway, by hand={EXAMPLES / '03_own_controller.py'}:Sway"
CYCLES = ["--set", "duration=3", "--set", "gait.period=0.8"]


@pytest.fixture(scope="module")
def stride(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from pythonfmu.builder import FmuBuilder  # noqa: PLC0415  a dependency of this test alone

    folder = tmp_path_factory.mktemp("stride")
    FmuBuilder.build_FMU(EXAMPLES / "controllers" / "stride.py", dest=folder)
    shutil.copy(EXAMPLES / "controllers" / "Stride.toml", folder)
    return folder / "Stride.fmu"


def test_four_controls_stand_in_one_table_and_one_report(
    call: Call, tmp_path: Path, stride: Path, request: pytest.FixtureRequest
) -> None:
    controls = ["kinematic", CPG, f"{stride}", SWAY]
    words = [word for text in controls for word in ("--control", text)]
    folder = tmp_path / "out"
    code, out, _ = call("compare", "walk_flat", *words, "--seeds", "2", *CYCLES, "-o", folder)
    assert code == 3  # the last one sways where it stands
    labels = ["kinematic", "Cpg", "Stride", "sway, by hand"]
    assert list(read_seeds(folder / "seeds.csv")) == labels
    table = json.loads((folder / "metrics.json").read_text())
    assert table["reference"] == "kinematic"
    assert list(table["changes"]) == labels[1:]
    assert table["walked"] == {**dict.fromkeys(labels, 2), "sway, by hand": 0}
    assert any("did not get ahead" in text for text in table["warnings"])
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "gainst kinematic control, sway, by hand" not in page  # nothing of it is praised
    for label in labels[1:]:
        assert f"{label} against kinematic" in page
    assert "compliant walks" not in page
    request.getfixturevalue("undrawn")
    code, _, _ = call("report", folder)
    assert code == 0
    assert "sway, by hand against kinematic" in out


def test_simulate_runs_each_control_into_a_folder_of_its_label(call: Call, tmp_path: Path) -> None:
    words = ["--control", "kinematic", "--control", CPG]
    code, out, _ = call(
        "simulate", "walk_flat", *words, "--set", "duration=0.2", "--set", "outputs.plots=false",
        "--set", "control.lift=0.2", "--json",
        "-o", tmp_path / "out",
    )  # fmt: skip
    assert code == 0
    assert list(json.loads(out)) == ["kinematic", "Cpg"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["Cpg", "kinematic"]
    facts = json.loads((tmp_path / "out" / "Cpg" / "run.json").read_text())
    assert (facts["control"], facts["controller"]["kind"]) == ("Cpg", "python")


def test_a_law_that_raises_ends_the_run_with_its_line_and_its_recording(
    call: Call, tmp_path: Path
) -> None:
    law = tmp_path / "law.py"
    law.write_text(
        "class Law:\n"
        "    def __init__(self, robot):\n"
        "        self.stance = robot.stance\n"
        "    def step(self, t, command, measurement):\n"
        "        return self.stance if t < 0.1 else self.stanec\n"
    )
    outcome = call(
        "simulate", "walk_flat", "--control", f"{law}:Law", "--set", "duration=1",
        "-o", tmp_path / "out",
    )  # fmt: skip
    assert_refused(
        outcome, f"the run ended at 0.095 s of 1 s: {law}, line 5, in step: AttributeError:"
    )
    assert (tmp_path / "out" / "results.partial.parquet").is_file()


def test_a_comparison_needs_two_controls(call: Call, tmp_path: Path) -> None:
    outcome = call("compare", "walk_flat", "--control", CPG, "-o", tmp_path / "out")
    assert_refused(outcome, "nothing to compare with", "use simulate")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("control", "other"), [("kinematic", "compliant"), ("paper", "kinematic")])
def test_a_refused_comparison_recommends_another_control(
    call: Call, tmp_path: Path, control: str, other: str
) -> None:
    outcome = call("compare", "walk_flat", "--control", control, "-o", tmp_path / "out")
    assert_refused(outcome, f"write --control {other} --control {control}, or use simulate")


TALKS = """
import os
import numpy as np

print("the file is read")


class Talks:
    def __init__(self, robot):
        self.angle = np.array(robot.stance)

    def step(self, t, command, measurement):
        print("a step")
        os.write(1, b"and C code prints")
        return self.angle
"""


def test_a_law_that_prints_does_not_spoil_the_json(tmp_path: Path) -> None:
    (tmp_path / "talks.py").write_text(TALKS, encoding="utf-8")
    controls = ["--control", "kinematic", "--control", f"{tmp_path / 'talks.py'}:Talks"]
    command = [*COMMAND, "compare", "stand", *controls, "--seeds", "2", *QUICK, "--json"]
    done = subprocess.run(
        [*command, "-o", str(tmp_path / "out")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert isinstance(json.loads(done.stdout), dict)
    for text in ("the file is read", "a step", "and C code prints"):
        assert text in done.stderr
