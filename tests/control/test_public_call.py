"""Tests hexapod_cosim.simulate and report with any controller, and what hexapod
controller new writes.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from inspect import getsourcelines
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import Call, assert_refused

import hexapod_cosim
from hexapod_cosim.controller import (
    BodyCommand,
    Controller,
    JointCommand,
    LegSolver,
    Measurement,
    make_gait,
    save_gains,
)
from hexapod_cosim.cosim.control.new_law import class_name, module_name, write_law
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.master.fmu import Fmu
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.run.batch import run_batch
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.single_run import simulate as run_scenario
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_from_table
from hexapod_cosim.cosim.scenario.tables import read_tables, with_values
from hexapod_cosim.models import (
    HexapodError,
    Robot,
    check_robot,
    foot_positions,
    load_robot,
    robot_from_table,
)

NEEDS_PUBLIC_CALL = pytest.mark.usefixtures("plant_build")
SHORT = {"duration": 0.3}
CYCLES = {"duration": 3, "gait.period": 0.8}
ROBOT, FLAT = load_robot("athena"), load_scenario("walk_flat")
CONTROLLER: dict[str, Any] = {"robot": ROBOT, "period": 0.005, "gait": make_gait(ROBOT)}


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


@NEEDS_PUBLIC_CALL
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


@NEEDS_PUBLIC_CALL
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


@NEEDS_PUBLIC_CALL
def test_a_controller_that_raises_ends_the_run_with_what_was_recorded() -> None:
    with pytest.warns(RuntimeWarning, match="ended early, without metrics: .*: no idea"):
        result = hexapod_cosim.simulate("walk_flat", Fails, settings=SHORT)
    assert result.outcome.status == "failed"
    assert result.recording.time[-1] == pytest.approx(0.1)  # the step at 0.105 s fails
    line = getsourcelines(Fails.step)[1] + 2
    place = f"{Path(__file__).resolve()}, line {line}, in step"
    assert f"{place}: RuntimeError: no idea" in result.outcome.reason


@pytest.fixture(scope="module")
def runs() -> list[Result]:
    return [
        hexapod_cosim.simulate("walk_flat", "kinematic", settings=CYCLES),
        hexapod_cosim.simulate("walk_flat", Stand, settings=CYCLES, label="my stand"),
    ]


@NEEDS_PUBLIC_CALL
def test_the_report_of_one_run_names_its_control(runs: list[Result], tmp_path: Path) -> None:
    page = hexapod_cosim.report(runs[1], tmp_path / "one")
    assert page == tmp_path / "one" / "report.html"
    assert "Control my stand, 3 s" in page.read_text(encoding="utf-8")
    assert "compliant control" not in page.read_text(encoding="utf-8").lower()
    assert json.loads((page.parent / "run.json").read_text())["control"] == "my stand"


@NEEDS_PUBLIC_CALL
def test_the_report_of_several_runs_compares_them(runs: list[Result], tmp_path: Path) -> None:
    page = hexapod_cosim.report(runs, tmp_path / "two")
    found = {path.name for path in page.parent.iterdir()}
    assert {"kinematic", "my stand", "seeds.csv", "metrics.json", "run.json", "plots"} <= found
    facts: dict[str, Any] = json.loads((page.parent / "run.json").read_text())
    assert facts["controls"] == ["kinematic", "my stand"]
    assert "my stand in 1 of 1" in page.read_text(encoding="utf-8")  # it did not arrive


@NEEDS_PUBLIC_CALL
def test_two_runs_of_one_label_are_refused(runs: list[Result], tmp_path: Path) -> None:
    with pytest.raises(HexapodError, match="two controls with one label"):
        hexapod_cosim.report([runs[0], runs[0]], tmp_path / "twice")
    assert not list(tmp_path.iterdir())


# `hexapod controller new`: the files it writes, and that its controller and an example walk.

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "controllers" / "cpg.py"


@pytest.mark.parametrize(
    ("name", "stem", "kind"), [("my_walk", "my_walk", "MyWalk"), ("MyWalk", "my_walk", "MyWalk")]
)
def test_a_name_gives_a_module_and_a_class(name: str, stem: str, kind: str) -> None:
    assert (module_name(name), class_name(name)) == (stem, kind)


def test_it_writes_a_controller_its_test_and_a_line(call: Call, tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("# Mine", encoding="utf-8")
    code, out, err = call("controller", "new", "my_walk", "-o", tmp_path)
    assert (code, err) == (0, "")
    assert f"hexapod simulate walk_flat --control {tmp_path / 'my_walk.py'}:MyWalk" in out
    assert (tmp_path / "README.md").read_text().startswith("# Mine\n- `my_walk.py`: ")
    test = (tmp_path / "test_my_walk.py").read_text()
    assert "@" not in test
    assert "class MyWalk:" in (tmp_path / "my_walk.py").read_text()


def test_the_test_that_it_writes_passes(call: Call, tmp_path: Path, plant_build: Path) -> None:
    assert call("controller", "new", "my_walk", "-o", tmp_path)[0] == 0
    run = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_my_walk.py"]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "2 passed" in done.stdout


def test_it_overwrites_nothing(call: Call, tmp_path: Path) -> None:
    (tmp_path / "test_walk.py").write_text("mine")
    assert_refused(call("controller", "new", "walk", "-o", tmp_path), "the file is there already")
    assert [path.name for path in tmp_path.iterdir()] == ["test_walk.py"]
    assert_refused(call("controller", "new", "my-walk", "-o", tmp_path), "not a name")


def test_the_controller_walks_and_turns_and_slips_less_than_kinematic_control(
    tmp_path: Path, plant_build: Path
) -> None:
    law = f"{write_law('my_walk', tmp_path)[0]}:MyWalk"
    settings = {"duration": 4, "robot": "athena"}
    ahead = hexapod_cosim.simulate("walk_flat", law, settings=settings)
    assert ahead.facts.walk.upright
    # 0.08 m/s for 4 s, less the ramp of one second
    assert ahead.recording.vector("torso.position")[-1, 0] == pytest.approx(0.28, rel=0.05)
    ours = hexapod_cosim.simulate("walk_flat", "kinematic", settings=settings)
    assert ahead.metrics["slip_per_metre"] < 0.6 * ours.metrics["slip_per_metre"]
    # it reports the plan of its feet, and its walk is not the robot file's
    assert 1e-4 < ahead.metrics["foot_error_stance"] < 0.02
    assert ahead.facts.walking.text == "own controller, figures over cycles of 1 s"
    turning = {**settings, "command.yaw_rate": 0.2, "robot": "phantomx_mk4"}
    turned = hexapod_cosim.simulate("walk_flat", law, settings=turning)
    assert turned.recording.column("torso.yaw")[-1] == pytest.approx(0.7, rel=0.05)


def test_the_pattern_generator_walks_forward_and_turns(plant_build: Path) -> None:
    settings = {"duration": 4, "robot": "phantomx_mk4", "command.yaw_rate": 0.2}
    turning = hexapod_cosim.simulate("walk_flat", f"{EXAMPLE}:Cpg", settings=settings)
    assert turning.facts.walk.upright
    # 4 s less the ramp of one second; the feet slip sideways on their arcs
    assert turning.recording.column("torso.yaw")[-1] == pytest.approx(0.7, rel=0.35)
    torso = turning.recording.vector("torso.position")
    assert np.linalg.norm(np.diff(torso[:, :2], axis=0), axis=1).sum() > 0.2  # m    of its arc


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        ({"scenario": None}, "scenario: wrong type of an argument: got 'nothing (None)'"),
        ({"scenario": 3}, "scenario: wrong type of an argument: got 3"),
        ({"settings": ["duration=3"]}, "settings: wrong type of an argument: got ['duration=3']"),
        ({"gains": 3}, "gains: wrong type of an argument: got 3"),
        ({"settings": {"duratoin": 3}}, "settings: unknown setting: got 'duratoin'"),
        ({"settings": {3: 1}}, "settings: wrong type of an argument: got 3"),
        ({"settings": {"seed": np.int64(-1)}}, "settings: seed: out of range: got np.int64(-1)"),
        ({"settings": {"seed": 2**70}}, "settings: seed: out of range: got 1180591620717411303424"),
        ({"settings": {"gait.period": "slow"}}, "settings: gait.period: wrong type: got 'slow'"),
        ({"settings": {"gait.perod": 1}}, "settings: gait.perod: unknown key: got 'perod'"),
        ({"settings": {"duration": np.nan}}, "settings: duration: value not allowed: got nan"),
        ({"settings": {"friction.mew": 1}}, "settings: friction.mew: unknown key: got 'mew'"),
        ({"settings": {"torso.mas": 1}}, "settings: torso.mas: unknown setting: got 'torso.mas'"),
        ({"settings": {"events": [{"time": "x"}]}}, "settings: events[0].time: "),
        ({"label": 3}, "label: wrong type of an argument: got 3"),
        ({"fmu": 3}, "fmu: wrong type of an argument: got 3"),
    ],
)
def test_arguments_of_another_type_are_refused(arguments: dict[str, Any], where: str) -> None:
    with pytest.raises(HexapodError) as refused:
        hexapod_cosim.simulate(**arguments)
    assert str(refused.value).startswith(where)
    assert "expected" in str(refused.value)


def batch(scenarios: Any) -> list[Summary]:
    return list(run_batch(scenarios))


@pytest.mark.parametrize(
    ("call", "arguments", "message"),
    [
        (export_fmu, {"robot": "athena", "path": "a.fmu"}, "robot: {}: got 'athena'"),
        (export_fmu, {"robot": ROBOT, "path": 3}, "path: {}: got 3"),
        (export_controller, {"setup": "paper", "path": "c.fmu"}, "setup: {}: got 'paper'"),
        (Fmu, {"path": 3}, "path: {}: got 3"),
        (Runner, {"fmu": 3}, "fmu: {}: got 3"),
        (Runner.simulate, {"self": None, "scenario": "walk_flat"}, "scenario: {}: got 'walk_flat'"),
        (run_scenario, {"scenario": "walk_flat"}, "scenario: {}: got 'walk_flat'"),
        (run_scenario, {"scenario": FLAT, "gains": "a.toml"}, "gains: {}: got 'a.toml'"),
        (batch, {"scenarios": None}, "scenarios: {}: got 'nothing (None)'"),
        (batch, {"scenarios": ["flat"]}, "scenario: {}: got 'flat'"),
        (Controller, CONTROLLER | {"robot": "athena"}, "robot: {}: got 'athena'"),
        (Controller, CONTROLLER | {"gait": "tripod"}, "gait: {}: got 'tripod'"),
        (Controller, CONTROLLER | {"period": "5 ms"}, "period: {}: got '5 ms'"),
        (Controller, CONTROLLER | {"gains": "stiff"}, "gains: {}: got 'stiff'"),
        (Controller, CONTROLLER | {"law": None}, "unknown law: expected one of"),
        (load_scenario, {"path_or_name": "stand", "overrides": "duration=3"}, "overrides: {}: got"),
        (load_robot, {"path_or_name": None}, "path: {}: got 'nothing (None)'"),
        (make_gait, {"robot": "athena"}, "robot: {}: got 'athena'"),
        (make_gait, {"robot": ROBOT, "name": 3}, "name: {}: got 3"),
        (make_gait, {"robot": ROBOT, "duty": "half"}, "duty: {}: got 'half'"),
        (make_gait, {"robot": ROBOT, "step_height": "high"}, "step_height: {}: got 'high'"),
        (robot_from_table, {"table": 3, "where": "mine"}, "mine: wrong type: got 3"),
        (check_robot, {"robot": "athena"}, "robot: {}: got 'athena'"),
        (foot_positions, {"robot": 3, "angle": np.zeros((6, 3))}, "robot: {}: got 3"),
        (foot_positions, {"robot": ROBOT, "angle": "folded"}, "angle: {}: got 'folded'"),
        (foot_positions, {"robot": ROBOT, "angle": [0.0, 1.0]}, "angle: {}: got 'shape (2,)'"),
        (foot_positions, {"robot": ROBOT, "angle": None}, "angle: {}: got 'None', expected an arr"),
        (save_gains, {"gains": ROBOT.gait, "path": "g.toml"}, "gains: {}: got Gait("),
        (save_gains, {"gains": None, "path": "g.toml"}, "gains: {}: got 'nothing (None)'"),
        (Measurement, {"angle": [0.0, 0.4, 1.8]}, "angle: {}: got 'shape (3,)'"),
        (Measurement, {"contact": "all"}, "contact: {}: got 'all'"),
        (LegSolver, {"robot": "athena"}, "robot: {}: got 'athena'"),
    ],
)
def test_calls_refuse_arguments_of_another_type(
    call: Callable[..., object], arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(HexapodError) as refused:
        call(**arguments)
    assert str(refused.value).startswith(message.format("wrong type of an argument"))


@pytest.mark.parametrize("results", [3, [], [3], "out/walk"])
def test_a_report_of_no_result_is_refused(results: Any, tmp_path: Path) -> None:
    with pytest.raises(HexapodError, match="results: wrong type of an argument"):
        hexapod_cosim.report(results, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@NEEDS_PUBLIC_CALL
def test_a_report_in_no_folder_and_a_column_of_no_name_are_refused(
    runs: list[Result], tmp_path: Path
) -> None:
    with pytest.raises(HexapodError, match=r"folder: wrong type of an argument: got 'nothing"):
        hexapod_cosim.report(runs, None)  # type: ignore[arg-type]
    with pytest.raises(HexapodError, match="column: wrong type of an argument: got 3"):
        runs[0].recording.column(3)  # type: ignore[arg-type]
    (tmp_path / "file").touch()
    with pytest.raises(HexapodError, match="cannot write: got 'a file where a folder should be'"):
        hexapod_cosim.report(runs, tmp_path / "file" / "out")


def test_numbers_of_numpy_are_settings() -> None:
    chosen = {"seed": np.int64(3), "duration": np.float32(2.0)}
    table = with_values(read_tables("walk_flat")[0], chosen)
    plan = scenario_from_table(table, where="walk_flat.toml")
    assert (plan.seed, type(plan.seed)) == (3, int)
    assert (plan.duration, type(plan.duration)) == (2.0, float)


def test_a_step_with_arguments_of_another_type_is_refused() -> None:
    controller, stand, sensed = Controller(**CONTROLLER), BodyCommand(), Measurement()
    with pytest.raises(HexapodError, match="command: wrong type of an argument: got 'nothing"):
        controller.step(0.0, None, sensed)  # type: ignore[arg-type]
    with pytest.raises(HexapodError, match="t: wrong type of an argument: got 'now'"):
        controller.step("now", stand, sensed)  # type: ignore[arg-type]
    with pytest.raises(HexapodError, match=r"measurement: wrong type of an argument: got \[\]"):
        controller.step(0.0, stand, [])  # type: ignore[arg-type]
    with pytest.raises(HexapodError, match="gains: wrong type of an argument: got 'compliant'"):
        controller.change_control("compliant")  # type: ignore[arg-type]
