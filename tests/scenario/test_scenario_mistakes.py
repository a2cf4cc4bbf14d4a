"""Mistakes in scenario files and in --set are reported with what was got and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_robot
from hexapod_cosim.models import RobotError, ScenarioError

MISTAKES = {
    "duraton=3": ["--set", "'duraton'", "did you mean 'duration'"],
    "duration": ["'duration'", "expected NAME=VALUE"],
    "contact.stifness=1": ["--set contact.stifness: unknown key", "did you mean 'stiffness'"],
    "contact.law=herz": ["contact.law", "'herz'", "did you mean 'hertz'"],
    "macro_step=5 mm": ["macro_step", "'5 mm'", "a value in s or ms"],
    "macro_step=0": ["macro_step", "got 0", "> 0"],
    "macro_step=1": ["macro_step", "<= 0.1"],
    "macro_step=0.003": ["duration", "multiple of macro_step = 0.003", "9.999"],
    "duration=1e9": [
        "--set duration: ",
        "too many macro-steps",
        "at most 1000000 macro-steps, 5000 s",
        "lengthen macro_step",
    ],
    "outputs.interval=0.012": [
        "outputs.interval",
        "got 0.012",
        "multiple of macro_step = 0.005",
        "0.01 is the nearest",
    ],
    "outputs.interval=-0.01": ["outputs.interval", "got -0.01", ">= 0"],
    "macro_step=5e-324": ["too many macro-steps"],
    "torso.mas=1": ["--set torso.mas: ", "did you mean 'torso.mass'"],
    "torso.roll=1": ["--set torso.roll: ", "a parameter of the FMU; this is an output"],
    "duration=ten": ["duration", "'ten'", "number"],
    "seed=-1": ["seed: out of range: got -1, expected a whole number from 0 to 2^63 - 1"],
    "seed=1.5": ["seed: wrong type: got 1.5, expected a whole number from 0"],
    "gait.stride=0.1": ["gait", "'stride'", "period"],
    "gait.duty=1": ["gait.duty", "got 1", "< 1"],
    "command=[{time=1},{time=0}]": ["command", "order", "time"],
    "command=3": ["command", "got 3", "table"],
    "events=[{time=1, duration=1, force=[1, 2]}]": ["events[0].force", "3 numbers"],
    "events=[{time=1, duration=1, force=['1 N', '2 Nm', 0]}]": [
        "events[0].force[1]",
        "'2 Nm'",
        "N",
    ],
    "events=[{time=1, leg='LF'}]": ["events[0].fault", "missing key", "dead, stuck"],
    "events=[{time=1, leg='LF', fault='deaf'}]": ["events[0].fault", "did you mean 'dead'"],
    "events=[{time=1, leg='LF', fault='dead', force=[1,2,3]}]": ["events[0]", "'force'", "leg"],
    "sensors.foot_force_delay=-0.01": ["foot_force_delay", ">= 0"],
    "compliance.paper_pid=0": ["compliance.paper_pid", "got 0", "true or false"],
    "complaince.paper_pid=false": [
        "--set complaince.paper_pid: ",
        "did you mean 'compliance.paper_pid'",
    ],
    "variation.height=-1 mm": ["variation.height", ">= 0"],
    "outputs.csv=torso": ["outputs.csv", "list"],
    "outputs.formats=['xlsx']": ["outputs.formats", "xlsx", "parquet, csv"],
    "outputs.formats=[]": ["outputs.formats", "some of parquet, csv, mcap"],
}


@pytest.mark.parametrize("setting", MISTAKES)
def test_a_mistake_is_reported_with_what_was_got_and_what_is_allowed(setting: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("walk_flat", overrides=[setting])
    message = str(caught.value)
    assert "\n" not in message
    for part in MISTAKES[setting]:
        assert part in message


@pytest.mark.parametrize("text", ["", "# nothing but a comment\n"])
def test_a_scenario_file_without_a_key_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    said = r"mine\.toml: an empty scenario: expected at least one key; write one, for example"
    with pytest.raises(ScenarioError, match=said):
        load_scenario(tmp_path / "mine.toml", overrides=["duration=1"])


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("macro_step = 0", "macro_step"),
        ("duration = 1e9", "duration"),
        ("command = {vx = 'a'}", "command.vx"),
        ("events = [{time = 1}]", "events[0].duration"),
        ("gait = {duty = 1}", "gait.duty"),
        ("outputs = {plots = 1}", "outputs.plots"),
        ("parameters = {'fricton.mu' = 1}", "parameters"),
        ("parameters = {torso.mass = 1}", "parameters"),
    ],
)
def test_a_mistake_in_a_file_is_reported_by_file_then_key(
    tmp_path: Path, text: str, place: str
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    assert caught.value.where == f"{path}: {place}"


def test_the_message_for_an_unknown_parameter_of_a_file_names_the_nearest_and_asks_for_quotes(
    tmp_path: Path,
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("parameters = {'torso.mas' = 1}")
    with pytest.raises(ScenarioError, match=r"got 'torso\.mas'.*did you mean 'torso\.mass'"):
        load_scenario(path)
    path.write_text("parameters = {torso.mass = 1}")
    with pytest.raises(ScenarioError, match=r"in quotes: \"torso\.mass\""):
        load_scenario(path)


def test_an_unknown_scenario_or_robot_is_reported_with_the_nearest_name() -> None:
    with pytest.raises(ScenarioError, match="did you mean 'walk_flat'"):
        load_scenario("walk_flt")
    with pytest.raises(RobotError, match="did you mean 'athena'"):
        scenario_robot(load_scenario("walk_flat", overrides=["robot=atena"]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("duration = ", "not a TOML file"),
        ("durration = 1", "did you mean 'duration'"),
        ("\udc80", "not a TOML file"),
    ],
)
def test_a_bad_file_is_reported_by_its_name(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(text.encode("utf-8", errors="surrogateescape"))
    with pytest.raises(ScenarioError, match=message) as caught:
        load_scenario(path)
    assert "mine.toml" in str(caught.value)
    with pytest.raises(ScenarioError, match="cannot read the scenario"):
        load_scenario(tmp_path / "missing.toml")
