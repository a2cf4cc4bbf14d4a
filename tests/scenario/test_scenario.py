"""Scenario files and --set: their content, units, gravity, gains, and what is refused of these."""

from __future__ import annotations

import math
import tomllib
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import tomlkit
from gains import make_gains

from hexapod_cosim.controller import SWITCHES, Controller, Parts, make_gait
from hexapod_cosim.cosim.run.gait_selection import known_robot
from hexapod_cosim.cosim.run.plan import chosen_gains
from hexapod_cosim.cosim.scenario import list_scenarios
from hexapod_cosim.cosim.scenario.events import Fault, Push
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_from_table, scenario_robot
from hexapod_cosim.cosim.scenario.records import Variation
from hexapod_cosim.models import RobotError, ScenarioError, load_robot


@pytest.mark.parametrize("name", list_scenarios())
def test_a_bundled_scenario_loads_and_fits_its_robot(name: str) -> None:
    scenario = load_scenario(name)
    robot = scenario_robot(scenario)
    gait = make_gait(robot, **dict(scenario.settings.get("gait", {})))
    Controller(robot, period=scenario.macro_step, gait=gait, gains=None)


@pytest.mark.parametrize("name", list_scenarios())
def test_the_scenario_as_run_reads_back_as_the_same(name: str) -> None:
    scenario = load_scenario(name)
    assert (
        scenario_from_table(tomllib.loads(tomlkit.dumps(scenario.to_table())), where=scenario.where)
        == scenario
    )


@pytest.mark.parametrize(
    ("setting", "value"), [("macro_step=5 ms", 0.005), ("duration=1 min", 60.0), ("start=-3", -3.0)]
)
def test_a_quantity_may_say_its_unit(setting: str, value: float) -> None:
    key = setting.partition("=")[0]
    assert getattr(load_scenario("walk_flat", overrides=[setting]), key) == value


def test_units_reach_into_commands_events_and_settings() -> None:
    overrides = [
        "command.yaw_rate=10 deg/s",
        "command.height=-5 mm",
        "terrain.kind=slope",
        "terrain.incline=5 deg",
        "events=[{time='10 ms', duration=1, force=['1 kN', 0, 0]}]",
    ]
    scenario = load_scenario("walk_flat", overrides=overrides)
    assert scenario.commands[0].yaw_rate == pytest.approx(math.radians(10.0))
    assert scenario.commands[0].height == -0.005
    assert scenario.settings["terrain"]["incline"] == pytest.approx(math.radians(5.0))
    push = scenario.events_of(Push)[0]
    assert (push.time, push.force) == (0.01, (1000.0, 0.0, 0.0))


def test_soil_is_set_by_the_name_of_a_preset() -> None:
    scenario = load_scenario("walk_flat", overrides=["soil=dry_sand"])
    assert scenario.settings["soil"]["law"] == "bekker"


def test_set_reaches_scenario_keys_and_hands_other_names_to_the_fmu() -> None:
    overrides = [
        "robot=phantomx_mk4",
        "contact.law=hertz",
        "LF.femur.mass=0.3",
        "outputs.csv=['torso.*']",
    ]
    scenario = load_scenario("walk_flat", overrides=overrides)
    assert scenario.robot == "phantomx_mk4"
    assert scenario.settings["contact"] == {"law": "hertz"}
    assert scenario.parameters == {"LF.femur.mass": 0.3}
    assert scenario.outputs.csv == ("torso.*",)


@pytest.mark.parametrize(
    ("overrides", "gravity"),
    [
        (["gravity=1.62"], (0.0, 0.0, -1.62)),
        (["gravity=3.71 m/s2"], (0.0, 0.0, -3.71)),
        (["gravity=[0.5, 0, -1.5]"], (0.5, 0.0, -1.5)),
        (["gravity[3]=-1.62"], (0.0, 0.0, -1.62)),
        (["gravity[1]=0.5"], (0.5, 0.0, -9.81)),
        (["gravity=3.71", "gravity[2]=0.1"], (0.0, 0.1, -3.71)),
    ],
)
def test_gravity_is_a_number_a_vector_or_an_fmu_parameter_and_all_are_one_key(
    overrides: list[str], gravity: tuple[float, float, float]
) -> None:
    scenario = load_scenario("walk_flat", overrides=overrides)
    assert scenario.gravity == gravity
    assert scenario.parameters == {}
    assert scenario_robot(scenario).gravity == known_robot(scenario).gravity == gravity
    assert (
        scenario_from_table(tomllib.loads(tomlkit.dumps(scenario.to_table())), where=scenario.where)
        == scenario
    )


@pytest.mark.parametrize(
    ("override", "message"),
    [
        (
            "gravity=-1.62",
            r"--set gravity: value not allowed: got -1\.62, "
            r"expected a finite number > 0 \[m/s2\]",
        ),
        ("gravity=0", r"gravity: value not allowed: got 0, expected a finite number > 0"),
        (
            "gravity=[0, -1.62]",
            r"gravity: wrong length: got \[0, -1\.62\], expected 3 numbers \[m/s2\]",
        ),
        ("gravity=1.62 m", r"gravity: wrong unit: got '1\.62 m', expected a value in m/s2"),
        ("gravity[3]=low", r"parameters\.gravity\[3\]: wrong type: got 'low'"),
    ],
)
def test_impossible_gravity_is_refused(override: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario("walk_flat", overrides=[override])


def test_a_number_in_quotes_is_refused_for_its_quotes() -> None:
    message = (
        r"number without unit in quotes: got '0\.1'.*a plain number, without quotes, is in m/s"
    )
    with pytest.raises(ScenarioError, match=message):
        load_scenario("walk_flat", overrides=["command.vx='0.1'"])


@pytest.mark.parametrize(
    "override", ["gravity=[0, 0, 1.62]", "gravity[3]=1.62", "gravity=[0, 0, 0]"]
)
def test_gravity_that_does_not_press_the_robot_onto_the_ground_is_refused(override: str) -> None:
    scenario = load_scenario("walk_flat", overrides=[override])
    with pytest.raises(
        ScenarioError,
        match=r"gravity: the robot cannot stand under this gravity: .* write gravity = 1\.62",
    ):
        scenario_robot(scenario)


def test_static_friction_is_refused_without_friction() -> None:
    scenario = load_scenario("walk_flat", overrides=["friction.law=none", "friction.mu_static=0.8"])
    message = (
        r"friction\.mu_static: static friction that has no effect: "
        r"got '0\.8 with the law none', expected friction\.law = tanh or bristle or lugre"
    )
    with pytest.raises(RobotError, match=message):
        scenario_robot(scenario)
    # the kinetic one's
    same = load_scenario("walk_flat", overrides=["friction.law=none", "friction.mu_static=0.7"])
    assert scenario_robot(same).friction.mu_static == 0.7


def test_a_first_command_later_than_the_start_is_preceded_by_standing() -> None:
    scenario = load_scenario("walk_flat", overrides=["command=[{time=1, vx=0.1}]"])
    assert [(command.time, command.vx) for command in scenario.commands] == [(0.0, 0.0), (1.0, 0.1)]


def test_a_robot_file_is_found_beside_its_scenario(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('robot = "robot.toml"\n')
    (tmp_path / "robot.toml").write_text("name = 3\n")
    scenario = load_scenario(tmp_path / "mine.toml")
    assert Path(scenario.robot) == tmp_path / "robot.toml"
    with pytest.raises(RobotError, match=r"robot\.toml"):
        scenario_robot(scenario)


EVERYTHING = [
    "events=[{time=1, leg='LM', fault='stuck'}, "
    "{time=2, leg='RF', fault='dead', duration='20 ms'}, {time=3, duration=1, force=[1, 2, 3]}]",
    "sensors.foot_force_delay=7 ms",
    "compliance.paper_pid=false",
    "variation.attitude=1 deg",
    "variation.command_delay=50 ms",
]


def test_faults_delays_switches_and_variations_are_read_and_written() -> None:
    scenario = load_scenario("walk_flat", overrides=EVERYTHING)
    assert [(event.leg, event.fault, event.duration) for event in scenario.events_of(Fault)] == [
        ("LM", "stuck", math.inf),
        ("RF", "dead", 0.02),
    ]
    assert [event.force for event in scenario.events_of(Push)] == [(1.0, 2.0, 3.0)]
    assert scenario.sensors.foot_force_delay == 0.007
    assert scenario.compliance == Parts(paper_pid=False)
    assert scenario.variation == Variation(attitude=math.radians(1.0), command_delay=0.05)
    assert (
        scenario_from_table(tomllib.loads(tomlkit.dumps(scenario.to_table())), where=scenario.where)
        == scenario
    )


def test_every_part_of_the_compliance_is_a_switch_and_all_are_on() -> None:
    default = asdict(load_scenario("walk_flat").compliance)
    assert all(default[key] for key in SWITCHES)
    for name in SWITCHES:
        other = str(not default[name]).lower()
        parts = load_scenario("walk_flat", overrides=[f"compliance.{name}={other}"]).compliance
        assert asdict(parts) == {**default, name: not default[name]}


def test_the_weight_of_the_squeeze_is_a_number_from_0_to_below_1() -> None:
    read = load_scenario("walk_flat", overrides=["compliance.squeeze=0.25"])
    assert read.compliance == Parts(squeeze=0.25)
    for text in ("-0.1", "1.0", "true", "'much'"):
        with pytest.raises(ScenarioError, match=r"compliance.squeeze.*expected a finite number"):
            load_scenario("walk_flat", overrides=[f"compliance.squeeze={text}"])


def test_gains_are_set_by_their_names_in_a_gains_file() -> None:
    names = ["gains.hold.path_rate=2", "gains.paper.damping=30"]
    plan = load_scenario("walk_flat", overrides=["control=compliant", *names])
    again = scenario_from_table(plan.to_table(), where="again")
    assert plan.gains == again.gains == {"hold": {"path_rate": 2.0}, "paper": {"damping": 30.0}}
    own = make_gains(load_robot("athena"))
    found = chosen_gains(plan, own)
    assert found == replace(
        own, hold=replace(own.hold, path_rate=2.0), paper=replace(own.paper, damping=30.0)
    )
    assert chosen_gains(replace(plan, control="kinematic"), own) is None


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("gains.hold.path_rat=2", "did you mean 'path_rate'"),
        ("gains.margins.gain=2", "unknown key"),
        ("gains.hold.path_rate=-2", "value not allowed"),
    ],
)
def test_gains_that_do_not_exist_or_fit_are_refused(name: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        load_scenario("walk_flat", overrides=[name])
