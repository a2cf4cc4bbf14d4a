"""Tests who chooses gait and stance of a run: the scenario, or else the control."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gains import make_gains

from hexapod_cosim.cosim.results.facts import gait_differences
from hexapod_cosim.cosim.run.gait_selection import GaitSelection, select_gait
from hexapod_cosim.cosim.run.plan import make_plan
from hexapod_cosim.cosim.scenario.reading import scenario_from_table
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.cosim.scenario.tables import read_overrides, with_values
from hexapod_cosim.models import ScenarioError, load_robot

ATHENA = load_robot("athena")
AGREEMENT = 1e-12  # rad    of joint angles, of both implementations


def scenario(*settings: str, control: str = "compliant") -> Scenario:
    table = {"control": control, "duration": 0.3, "command": {"vx": 0.08}}
    return scenario_from_table(with_values(table, read_overrides(settings)), where="mine.toml")


def walk(*settings: str, control: str = "compliant") -> GaitSelection:
    return select_gait(scenario(*settings, control=control))


def test_where_nothing_is_named_compliant_control_ambles_nearer_to_the_hips() -> None:
    chosen = walk()
    assert chosen.gait.name == "amble"
    assert (chosen.outward, chosen.deeper) == pytest.approx((-0.01998, 0.0189))
    assert (chosen.stance, chosen.chosen_by) == ("chosen", "control")
    # the rest of the way to the stance of least heat, for a load that is unknown
    assert chosen.gait.narrowing == pytest.approx(0.02997)


@pytest.mark.parametrize(
    ("control", "by"),
    [("kinematic", "robot file"), ("paper", "robot file"), ("law.py:Mine", "own controller")],
)
def test_all_other_controls_walk_as_the_robot_file_says(control: str, by: str) -> None:
    plain = walk(control=control)
    assert (plain.gait.name, plain.stance, plain.chosen_by) == ("tripod", "own", by)
    assert plain.robot == ATHENA


@pytest.mark.parametrize("control", ["kinematic", "paper", "law.py:Mine"])
def test_any_control_can_walk_as_compliant_control_chooses(control: str) -> None:
    chosen = walk()
    assert walk(control=f"{control}@chosen") == chosen
    named = walk("walk.stance=chosen", control=control)
    assert replace(named, chosen_by="control") == chosen
    assert walk(control="compliant@own") == walk(control="kinematic")


def test_a_gait_that_is_named_beside_the_chosen_stance_stays() -> None:
    named = walk("walk.stance=chosen", "gait.name=tripod", control="kinematic")
    assert (named.gait.name, named.stance, named.chosen_by) == ("tripod", "chosen", "scenario")
    assert walk("gait.name=ripple", control="kinematic@chosen").stance == "own"


@pytest.mark.parametrize(
    "setting", ["gait.name=ripple", "gait.period=0.9", "gait.duty=0.55", "walk.stance=own"]
)
def test_a_scenario_that_names_gait_or_stance_chooses_the_walk_of_every_control(
    setting: str,
) -> None:
    kinematic, compliant = walk(setting, control="kinematic"), walk(setting)
    assert kinematic == compliant
    assert (compliant.chosen_by, compliant.robot) == ("scenario", ATHENA)
    assert compliant.gait.narrowing == 0.0


def test_a_command_too_fast_for_an_amble_is_walked_in_the_robots_gait() -> None:
    fast = walk("command.vx=0.26")
    assert (fast.gait.name, fast.stance) == ("tripod", "chosen")


def test_joints_at_their_largest_speed_keep_the_robots_own_walk() -> None:
    """The PhantomX has little speed to spare: its joints could follow no other walk."""
    slow = walk("robot=phantomx_mk4", "command.vx=0.06")
    assert (slow.gait.name, slow.stance, slow.chosen_by) == ("tripod", "own", "control")
    assert slow.gait.narrowing == 0.0


def test_a_stance_is_given_as_two_lengths() -> None:
    given = walk("walk.stance=['-20 mm', 0.01]", control="kinematic")
    assert (given.stance, given.outward, given.deeper) == ("given", -0.02, 0.01)
    assert given.gait.name == "tripod"
    assert not np.allclose(given.robot.stance, ATHENA.stance)
    designed = walk("walk.stance=designed", control="kinematic")
    assert (designed.outward, designed.deeper) == pytest.approx((-0.05265, 0.0189))


def test_impossible_stances_are_refused_with_a_fix() -> None:
    with pytest.raises(ScenarioError, match=r"mine.toml: walk.stance: .* did you mean 'designed'"):
        scenario("walk.stance=desined")
    with pytest.raises(ScenarioError, match=r"the legs do not reach this stance: got '0\.3 m outw"):
        walk("walk.stance=[0.3, 0.0]")
    with pytest.raises(ScenarioError, match=r"walk\.stance"):
        scenario("walk.stance=[0.3]")
    with pytest.raises(ScenarioError, match="did you mean 'stance'"):
        scenario("walk.stanse=own")


def test_gains_for_the_robots_own_stance_keep_its_own_walk() -> None:
    kept = select_gait(scenario(), gains=make_gains(ATHENA))
    assert (kept.gait.name, kept.stance) == ("tripod", "own")
    other = replace(make_gains(ATHENA), robot_hash="of another robot")
    assert select_gait(scenario(), gains=other).gait.name == "amble"


def test_plant_and_controller_stand_in_the_chosen_stance() -> None:
    plan = make_plan(scenario())
    stance = plan.selection.robot.stance
    np.testing.assert_array_equal(plan.robot.stance, stance)
    np.testing.assert_array_equal(plan.controller.robot.stance, stance)
    assert plan.controller.gains is not None
    assert plan.controller.gains.robot_hash == plan.controller.robot.hash
    assert not math.isclose(stance[0, 1], ATHENA.stance[0, 1], rel_tol=0.1)


def test_the_report_says_how_the_controls_walk_when_they_differ() -> None:
    facts = {"kinematic": walk(control="kinematic").as_facts(), "compliant": walk().as_facts()}
    assert gait_differences(facts) == [
        "kinematic: tripod, period 1 s, the robot file's stance, chosen by the robot file",
        "compliant: amble, period 1.5 s, feet 20 mm nearer to the hips and 19 mm deeper below "
        "them, chosen by the control",
    ]
    assert gait_differences({"a": facts["kinematic"], "b": facts["kinematic"]}) == []
