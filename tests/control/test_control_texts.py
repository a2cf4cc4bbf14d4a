"""Texts that name a control: a built-in one, law.py:Class, controller.fmu, each with a label."""

from __future__ import annotations

from pathlib import Path

import pytest

from hexapod_cosim.cosim.control import parse_control
from hexapod_cosim.cosim.scenario.controls import parse_controls, reference_of
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_from_table
from hexapod_cosim.models import ScenarioError

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
