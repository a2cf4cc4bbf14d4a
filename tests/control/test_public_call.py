"""hexapod_cosim.simulate and report: any controller, its recording, metrics and files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hexapod_cosim
from hexapod_cosim.controller import BodyCommand, JointCommand, Measurement
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.models import HexapodError, Robot

pytestmark = pytest.mark.usefixtures("plant_build")
SHORT = {"duration": 0.3}
CYCLES = {"duration": 3, "gait.period": 0.8}


class Stand:
    """Stands; `bend` is added to all femurs."""

    def __init__(self, robot: Robot, bend: float = 0.0) -> None:
        self.angle = np.array(robot.stance)
        self.angle[:, 1] += bend

    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        return JointCommand(angle_ref=self.angle)


class Fails(Stand):
    def step(self, t: float, command: BodyCommand, measurement: Measurement) -> JointCommand:
        if t > 0.1:
            raise RuntimeError("no idea")
        return super().step(t, command, measurement)


def test_a_built_in_control_gives_recording_metrics_and_facts() -> None:
    result = hexapod_cosim.simulate("walk_flat", "kinematic", settings=CYCLES)
    assert isinstance(result, Result)
    assert set(result.metrics) == set(METRICS)
    assert result.recording.time[-1] == 3.0
    assert result.facts.controller == {"kind": "builtin", "text": "kinematic"}
    assert f"{result!r}".startswith(
        f"Result({result.scenario.title!r}, control='kinematic', status='completed', simulated=3, "
        "slip_per_metre="
    )
    assert len(f"{result!r}") < 300


def test_a_class_and_an_object_of_it_give_the_same_run() -> None:
    settings = {**SHORT, "control.bend": 0.05}
    made = hexapod_cosim.simulate("walk_flat", Stand, settings=settings)
    given = hexapod_cosim.simulate("walk_flat", Stand(hexapod_athena(), 0.05), settings=SHORT)
    text = hexapod_cosim.simulate(
        "walk_flat", f"{Path(__file__).resolve()}:Stand", settings=settings
    )
    assert np.array_equal(made.recording.data, given.recording.data)
    assert np.array_equal(made.recording.data, text.recording.data)
    assert np.array_equal(
        made.recording.joints("angle_ref")[0], Stand(hexapod_athena(), 0.05).angle
    )


def hexapod_athena() -> Robot:
    from hexapod_cosim.models import load_robot  # noqa: PLC0415

    return load_robot("athena")


def test_a_controller_that_raises_ends_the_run_with_what_was_recorded() -> None:
    with pytest.warns(RuntimeWarning, match="ended early, without metrics: .*: no idea"):
        result = hexapod_cosim.simulate("walk_flat", Fails, settings=SHORT)
    assert result.outcome.status == "failed"
    assert result.recording.time[-1] == pytest.approx(0.1)  # the step at 0.105 s fails
    assert f"{Path(__file__).resolve()}, line 37, in step: RuntimeError: no idea" in (
        result.outcome.reason
    )


@pytest.fixture(scope="module")
def runs() -> list[Result]:
    return [
        hexapod_cosim.simulate("walk_flat", "kinematic", settings=CYCLES),
        hexapod_cosim.simulate("walk_flat", Stand, settings=CYCLES, label="my stand"),
    ]


def test_the_report_of_one_run_names_its_control(runs: list[Result], tmp_path: Path) -> None:
    page = hexapod_cosim.report(runs[1], tmp_path / "one")
    assert page == tmp_path / "one" / "report.html"
    assert "Control my stand, 3 s" in page.read_text(encoding="utf-8")
    assert "compliant control" not in page.read_text(encoding="utf-8").lower()
    assert json.loads((page.parent / "run.json").read_text())["control"] == "my stand"


def test_the_report_of_several_runs_compares_them(runs: list[Result], tmp_path: Path) -> None:
    page = hexapod_cosim.report(runs, tmp_path / "two")
    found = {path.name for path in page.parent.iterdir()}
    assert {"kinematic", "my stand", "seeds.csv", "metrics.json", "run.json", "plots"} <= found
    facts: dict[str, Any] = json.loads((page.parent / "run.json").read_text())
    assert facts["controls"] == ["kinematic", "my stand"]
    assert "my stand in 1 of 1" in page.read_text(encoding="utf-8")  # it did not arrive


def test_two_runs_of_one_label_are_refused(runs: list[Result], tmp_path: Path) -> None:
    with pytest.raises(HexapodError, match="two controls with one label"):
        hexapod_cosim.report([runs[0], runs[0]], tmp_path / "twice")
    assert not list(tmp_path.iterdir())
