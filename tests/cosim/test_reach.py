"""Commands that the legs cannot follow are refused before the run, with the largest possible."""

from __future__ import annotations

import re

import pytest

from hexapod_cosim.controller import BodyCommand, Controller, Measurement, make_gait
from hexapod_cosim.cosim.scenario.bundled import list_scenarios
from hexapod_cosim.cosim.scenario.reach import check_commands
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_robot
from hexapod_cosim.cosim.scenario.records import Command
from hexapod_cosim.models import ScenarioError, load_robot

ROBOT = load_robot("athena")
LIMIT = re.compile(r"(\w+) = (\S+) ")


def refusal(*commands: Command, gait: str = "tripod") -> ScenarioError:
    with pytest.raises(ScenarioError) as caught:
        check_commands(commands, ROBOT, make_gait(ROBOT, gait), where="mine.toml: command")
    return caught.value


@pytest.mark.parametrize("name", list_scenarios())
def test_every_bundled_walk_is_within_reach(name: str) -> None:
    scenario = load_scenario(name)
    robot = scenario_robot(scenario)
    check_commands(
        scenario.commands,
        robot,
        make_gait(robot, **dict(scenario.settings.get("gait", {}))),
        where=name,
    )


@pytest.mark.parametrize(
    ("wanted", "gait"),
    [
        ({"vx": 10.0}, "tripod"),
        ({"vy": 2.0, "height": 0.02}, "tripod"),
        ({"yaw_rate": 8.0}, "ripple"),
        ({"vx": 0.3, "yaw_rate": 0.1}, "wave"),
        ({"height": 0.5}, "tripod"),
    ],
)
def test_the_reported_limit_can_be_walked_and_a_little_more_cannot(
    wanted: dict[str, float], gait: str
) -> None:
    limit = {
        key: float(value)
        for key, value in LIMIT.findall(str(refusal(Command(**wanted), gait=gait).expected))
        if key in wanted
    }
    assert set(limit) <= set(wanted)
    assert limit
    motionless = {
        key: wanted[key] for key in ("height", "roll") if key in wanted and key not in limit
    }
    check_commands([Command(**motionless, **limit)], ROBOT, make_gait(ROBOT, gait), where="")
    refusal(Command(**motionless, **{key: 1.03 * value for key, value in limit.items()}), gait=gait)


def unreachable(speed: float) -> tuple[bool, bool]:
    """Whether a standing foot, and any foot, is out of reach from 2 s to 6 s of a tripod walk."""
    period, measurement = 0.005, Measurement()
    controller = Controller(ROBOT, period=period, gait=make_gait(ROBOT, "tripod"))
    shown, standing, anyone = controller.diagnostics, False, False
    for k in range(1200):
        controller.step(k * period, BodyCommand(vx=speed), measurement)
        if k < 400:
            continue
        standing |= bool((shown.unreachable & ~shown.swinging).any())
        anyone |= bool(shown.unreachable.any())
    return standing, anyone


def test_the_limit_is_that_of_a_long_walk() -> None:
    limit = float(LIMIT.findall(str(refusal(Command(vx=10.0)).expected))[0][1])
    assert not unreachable(limit)[0]
    assert unreachable(1.03 * limit)[0]


def test_feet_beyond_reach_only_in_the_air_are_let_pass() -> None:
    assert unreachable(0.5) == (False, True)
    check_commands([Command(vx=0.5)], ROBOT, make_gait(ROBOT, "tripod"), where="")


def test_the_limit_shrinks_with_the_time_a_foot_stands() -> None:
    tripod, wave = (
        float(LIMIT.findall(str(refusal(Command(vx=10.0), gait=gait).expected))[0][1])
        for gait in ("tripod", "wave")
    )
    assert wave < 0.5 * tripod


def test_the_one_impossible_command_among_several_is_reported_by_its_time() -> None:
    assert (
        refusal(Command(vx=0.08), Command(time=2.5, vx=3.0)).where
        == "mine.toml: command at time = 2.5 s"
    )


@pytest.mark.filterwarnings("error")
def test_absurd_numbers_are_refused_like_any_other() -> None:
    assert "vx = 1e+300 m/s" in str(refusal(Command(vx=1e300)))
    assert "posture" in refusal(Command(vx=1e308, height=0.5)).what
