"""Tests the texts that name a control, and a user's class: its arguments, its
commands and its exceptions.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexapod_cosim.controller import BodyCommand, ControllerError, JointCommand, Measurement
from hexapod_cosim.cosim.control.controllers import check_control
from hexapod_cosim.cosim.control.python_law import PythonLaw, build, load_class
from hexapod_cosim.cosim.scenario.controls import parse_control, parse_controls, reference_of
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_from_table
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES, ScenarioError

GIVEN = {"robot": "the robot", "period": 0.005, "gait": "the gait"}


def written(folder: Path, text: str) -> Path:
    path = folder / "law.py"
    path.write_text(text, encoding="utf-8")
    return path


def made(folder: Path, text: str, settings: Mapping[str, Any] | None = None) -> Any:
    path = written(folder, text)
    return build(load_class(path, "Law"), path, GIVEN, settings or {})


def stepped(law: Any, path: Path | None = None) -> JointCommand:
    return PythonLaw(law, path=path).step(0.25, BodyCommand(), Measurement())


def test_the_class_gets_what_it_asks_for_by_name(tmp_path: Path) -> None:
    law = made(
        tmp_path,
        "class Law:\n"
        "    def __init__(self, gait, lift, *, period, gain=2.0):\n"
        "        self.got = gait, lift, period, gain\n"
        "    def step(self, t, command, measurement): ...\n",
        {"lift": 0.3, "unused": 1},
    )
    assert law.got == ("the gait", 0.3, 0.005, 2.0)


def test_a_missing_parameter_is_named(tmp_path: Path) -> None:
    with pytest.raises(ControllerError, match=r"got 'amplitude'.*--set control.amplitude=VALUE"):
        made(tmp_path, "class Law:\n    def __init__(self, amplitude): ...\n")


def test_a_class_without_step_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ControllerError, match="Law has no method step"):
        made(tmp_path, "class Law: ...\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import nothing_of_this_name\n", "line 1, in <module>: ModuleNotFoundError: No module"),
        ("class Law:\n    x = = 1\n", "line 2: SyntaxError: invalid syntax"),
        (
            "class Law:\n    def __init__(self):\n        raise ValueError('two\\nlines')\n",
            "line 3, in __init__: ValueError: two lines; correct the line `raise ValueError(",
        ),
        (
            "import sys\nsys.exit(0)\n",
            "line 2, in <module>: SystemExit: 0; a controller must not end the program",
        ),
    ],
)
def test_an_exception_is_explained_in_one_line_with_the_users_line(
    text: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(ControllerError) as caught:
        made(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'law.py'}, {message}")
    assert "\n" not in str(caught.value)


def test_a_step_with_other_arguments_is_refused_before_the_run(tmp_path: Path) -> None:
    path = written(tmp_path, "class Law:\n    def step(self, t, command): ...\n")
    law = build(load_class(path, "Law"), path, GIVEN, {})
    with pytest.raises(ControllerError) as caught:
        PythonLaw(law, path=path)
    assert str(caught.value) == (
        f"{path}: Law.step takes other arguments: got 'step(t, command)', expected "
        "step(t, command, measurement); write `def step(self, t, command, measurement):`"
    )


def test_a_class_of_c_code_has_no_step() -> None:
    with pytest.raises(ControllerError, match=r"^builtins: dict has no method step"):
        build(dict, Path("builtins"), GIVEN, {})


def test_an_exception_outside_the_users_file_quotes_no_line_of_ours(tmp_path: Path) -> None:
    path = written(tmp_path, "")

    class Law:
        def step(self, t: float, command: BodyCommand, measurement: Measurement) -> Any:
            return [[1.0, 2.0], [3.0]]  # no array

    with pytest.raises(ControllerError) as caught:
        stepped(Law(), path)
    assert str(caught.value).startswith(f"{path}: ValueError: setting an array element")
    assert str(caught.value).endswith("; correct the controller")


def test_joint_angles_alone_are_a_command() -> None:
    class Law:
        def step(self, t: float, command: BodyCommand, measurement: Measurement) -> Any:
            return np.full((6, 3), 0.5)

    command = stepped(Law())
    assert (command.angle_ref == 0.5).all()
    assert not command.speed_ref.any()


@pytest.mark.parametrize(
    ("result", "message"),
    [
        (None, "step returns no joint command: got 'NoneType'"),
        (np.zeros(18), "step returns no joint command: got 'an array (18,)'"),
        (JointCommand(speed_ref=np.zeros(18)), "speed_ref has a wrong shape: got (18,)"),
    ],
)
def test_another_result_is_refused(result: Any, message: str) -> None:
    class Law:
        def step(self, t: float, command: BodyCommand, measurement: Measurement) -> Any:
            return result

    with pytest.raises(ControllerError) as caught:
        stepped(Law())
    assert message in str(caught.value)


def test_a_number_that_is_not_finite_is_named_by_joint() -> None:
    class Law:
        def step(self, t: float, command: BodyCommand, measurement: Measurement) -> Any:
            angle = np.zeros((6, 3))
            angle[LEG_NAMES.index("RM"), JOINT_NAMES.index("femur")] = np.nan
            return angle

    with pytest.raises(ControllerError, match=r"RM.femur.angle_ref is not finite at 0.25 s"):
        stepped(Law())


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    path = written(tmp_path, "class Law:\n    number = 1\n")
    assert load_class(path, "Law").number == 1
    written(tmp_path, "class Law:\n    number = 22\n")
    assert load_class(path, "Law").number == 22


def test_modules_beside_the_file_can_be_imported(tmp_path: Path) -> None:
    (tmp_path / "beside_the_law.py").write_text("NUMBER = 7\n")
    path = written(tmp_path, "import beside_the_law\nclass Law:\n    x = beside_the_law.NUMBER\n")
    assert load_class(path, "Law").x == 7


def test_a_parameter_that_no_control_takes_is_refused(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "class Law:\n    def __init__(self, lift=1): ...\n    def step(self, t, c, m): ...\n",
    )
    control = parse_control(f"{path}:Law", where="test")
    table = {"control": {"law": control.text, "lfit": 3}}
    with pytest.raises(ControllerError, match=r"test: control: no control takes.*'lift'"):
        check_control(scenario_from_table(table, where="test"), [control])
    table = {"control": {"law": control.text, "lift": 3, "Law": {"lift": 4}, "other": {"x": 1}}}
    check_control(scenario_from_table(table, where="test"), [control])


# Texts that name a control: a built-in one, law.py:Class, controller.fmu, each with a label.

HERE = Path("/laws")


@pytest.mark.parametrize(
    ("text", "label", "kind", "name", "path"),
    [
        ("compliant", "compliant", "builtin", "compliant", None),
        ("a b=kinematic", "a b", "builtin", "kinematic", None),
        ("law.py:Cpg", "Cpg", "python", "Cpg", HERE / "law.py"),
        ("fast=sub/law.py:Cpg", "fast", "python", "Cpg", HERE / "sub/law.py"),
        ("/x/ctrl.fmu", "ctrl", "fmu", "ctrl", Path("/x/ctrl.fmu")),
        ("mine = ctrl.fmu", "mine", "fmu", "ctrl", HERE / "ctrl.fmu"),
        ("object:Cpg", "Cpg", "python", "Cpg", None),
        ("paper@chosen", "paper@chosen", "builtin", "paper", None),
        ("mine=law.py:Cpg@own", "mine", "python", "Cpg", HERE / "law.py"),
    ],
)
def test_a_text_names_a_control(
    text: str, label: str, kind: str, name: str, path: Path | None
) -> None:
    found = parse_control(text, where="test", base=HERE)
    assert (found.label, found.kind, found.name, found.path) == (label, kind, name, path)
    assert parse_control(found.text, where="test") == found


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("complaint", "did you mean 'compliant'?"),
        ("law.py", "name its class: law.py:MyController"),
        ("kinematic@amble", "with @own or @chosen or without"),
        ("ctrl.fmu@chosen", "unknown control"),
        ("=compliant", "not a label"),
        ("a/b=compliant", "not a label"),
        ("plots=compliant", "not a label"),
        ("..=compliant", "not a label"),
        ("", "unknown control"),
    ],
)
def test_any_other_text_is_refused_with_what_to_write(text: str, message: str) -> None:
    with pytest.raises(ScenarioError, match="--control: ") as caught:
        parse_control(text, where="--control")
    assert message in str(caught.value)


def test_a_control_has_its_own_walk_or_the_one_it_is_named_with() -> None:
    chooses = {
        text: parse_control(text, where="test").chooses
        for text in ("kinematic", "kinematic@chosen", "compliant", "compliant@own")
    }
    assert chooses == {
        "kinematic": False,
        "kinematic@chosen": True,
        "compliant": True,
        "compliant@own": False,
    }
    own = parse_control("compliant", where="test").walking("own")
    assert (own.label, own.text) == ("compliant", "compliant=compliant@own")


@pytest.mark.parametrize(
    ("label", "reference"),
    [
        ("compliant", "kinematic"),
        ("kinematic@chosen", "kinematic"),
        ("compliant@chosen", "kinematic@chosen"),
        ("paper@own", "kinematic"),
    ],
)
def test_a_control_is_compared_with_the_first_one_in_its_walk(label: str, reference: str) -> None:
    assert reference_of(label, ["kinematic", "kinematic@chosen", label]) == reference


def test_two_controls_of_a_command_have_two_labels() -> None:
    with pytest.raises(ScenarioError, match="give one of them another label: other=Cpg"):
        parse_controls(["a.py:Cpg", "b.py:Cpg"], where="--control")
    found = parse_controls(["a.py:Cpg", "b=b.py:Cpg"], where="--control")
    assert [control.label for control in found] == ["Cpg", "b"]


def test_a_scenario_gives_the_control_as_a_text_or_as_a_table_with_parameters() -> None:
    plain = scenario_from_table({"control": "compliant"}, where="test")
    assert (plain.control, dict(plain.control_settings)) == ("compliant", {})
    table = {"control": {"law": "/x/law.py:Cpg", "lift": 0.2, "map": {"a": "b"}}}
    full = scenario_from_table(table, where="test")
    assert full.control == "/x/law.py:Cpg"
    assert full.control_settings == {"lift": 0.2, "map": {"a": "b"}}
    again = scenario_from_table(full.to_table(), where="test")
    assert (again.control, again.control_settings) == (full.control, full.control_settings)


def test_a_relative_path_in_a_scenario_file_starts_at_the_file(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text("class Cpg: ...\n")
    (tmp_path / "walk.toml").write_text('control = "x=law.py:Cpg@chosen"\n')
    plan = load_scenario(tmp_path / "walk.toml")
    assert plan.control == f"x={tmp_path / 'law.py'}:Cpg@chosen"
