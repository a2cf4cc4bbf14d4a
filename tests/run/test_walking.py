"""Tests the whole co-simulation, and commands that the legs cannot follow."""

from __future__ import annotations

import re
from pathlib import Path

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray

from hexapod_cosim.controller import BodyCommand, Controller, Measurement, make_gait
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario import list_scenarios
from hexapod_cosim.cosim.scenario.reach import check_commands
from hexapod_cosim.cosim.scenario.reading import load_scenario, scenario_robot
from hexapod_cosim.cosim.scenario.records import Command
from hexapod_cosim.models import LEG_NAMES, Robot, ScenarioError, load_robot

COMMANDED, SHARE = 0.08, 0.10  # m/s, 1: how near to it the mean speed must come
LEVEL = 0.02  # rad    of roll and pitch in a walk on flat ground: a fall is beyond 0.6
SWAY, PERIOD, LOOK = 0.05, 1.0, 0.7  # rad, s, s
STEPS = (4e-3, 2e-3, 1e-3, 5e-4)  # s
# of the order by regression over a factor of eight: the next term of the error still shows
SLOPE = 0.15


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize(
    ("robot", "control"), [("athena", "compliant"), ("phantomx_mk4", "kinematic")]
)
def test_a_robot_walks_for_a_minute_at_the_commanded_speed_without_falling(
    robot: str, control: str
) -> None:
    """On the loop in C; its walks are those of the Python loop (test_runner.py)."""
    scenario = load_scenario(
        "walk_flat", overrides=[f"robot={robot}", f"control={control}", "duration=60"]
    )
    with Runner(everything=True) as runner:
        result = runner.simulate(scenario)
    assert result.completed
    recording = result.outcome.recording
    assert recording.time[-1] == pytest.approx(60.0)
    assert np.all(np.abs(recording.columns(["torso.roll", "torso.pitch"])) < LEVEL)
    height = recording.column("torso.position[3]")
    assert height.min() > 0.9 * height[0]
    position = recording.vector("torso.position")
    forward = position[-1, 0] - position[np.searchsorted(recording.time, 2.0), 0]
    assert forward / 58.0 == pytest.approx(COMMANDED, rel=SHARE)


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize(("control", "most"), [("paper", 0.15), ("compliant", 0.22)])
def test_a_hexapod_with_measured_servos_slips_less_than_without_control(
    control: str, most: float
) -> None:
    """Its feet slip by 0.24 m/m under kinematic control; no servo is taken for a faulty one."""
    sets = ["robot=sts3215_hexapod", f"control={control}", "duration=5"]
    with Runner(everything=True) as runner:
        result = runner.simulate(load_scenario("walk_flat", overrides=sets))
    assert result.completed
    assert result.metrics["slip_per_metre"] < most
    assert not result.outcome.recording.columns(
        [f"controller.{leg}.absent" for leg in LEG_NAMES]
    ).any()


def swaying(robot: Robot, ahead: float) -> NDArray[np.void]:
    """Returns joint commands that turn and lift the torso once per period, as input for fmpy.

    The commands at time t are those of the motion at t + ahead.
    """
    time = np.arange(0.0, LOOK + 2e-2, 1e-4)
    phase = 2.0 * np.pi * (time + ahead) / PERIOD
    angle, speed = 0.5 * SWAY * (1.0 - np.cos(phase)), np.pi * SWAY / PERIOD * np.sin(phase)
    columns = {"time": time}
    for leg, stance in zip(LEG_NAMES, robot.stance, strict=True):
        for joint, share, start in zip(("coxa", "femur"), (1.0, -0.5), stance[:2], strict=True):
            columns |= {
                f"{leg}.{joint}.angle_ref": start + share * angle,
                f"{leg}.{joint}.speed_ref": share * speed,
            }
    rows = np.zeros(len(time), dtype=[(name, np.float64) for name in columns])
    for name, values in columns.items():
        rows[name] = values
    return rows


def torso_at(fmu: Path, h: float, *, middle: bool) -> NDArray[np.float64]:
    """Returns torso position and yaw at LOOK after macro-steps of h.

    Commands are sampled at each step's start or middle and held.
    """
    result = fmpy.simulate_fmu(
        str(fmu),
        stop_time=LOOK,
        step_size=h,
        output_interval=h,
        start_values={"solver.tolerance": 1e-9},
        input=swaying(load_robot("athena"), 0.5 * h if middle else 0.0),
        output=["torso.position[1]", "torso.position[3]", "torso.yaw"],
    )
    row = int(np.argmin(np.abs(result["time"] - LOOK)))
    assert result["time"][row] == pytest.approx(LOOK)
    return np.array([result[name][row] for name in result.dtype.names[1:]])


@pytest.mark.parametrize(("middle", "order"), [(False, 1), (True, 2)])
def test_the_co_simulation_error_falls_with_the_macro_step(
    athena_fmu: Path, middle: bool, order: int
) -> None:
    """A command held from a step's start lags by h/2, which gives order 1.

    One sampled at the step's middle has no lag: order 2.
    """
    exact = torso_at(athena_fmu, 1.25e-4, middle=True)
    errors = [float(np.linalg.norm(torso_at(athena_fmu, h, middle=middle) - exact)) for h in STEPS]
    slope = np.polyfit(np.log(STEPS), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=SLOPE)


# Commands that the legs cannot follow are refused before the run, with the largest possible.

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
    controller.plan.aim = controller.plan.ramp.aim  # type: ignore[assignment, method-assign]
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


# Commands around the speed limit of the joints: walks slow down, and say so.

SHARES = (0.8, 1.0, 1.2)  # of the largest command that the joints can follow
SOFT = 0.7  # body weights    largest peak force


@pytest.mark.parametrize("friction", ["tanh", "bristle"])
@pytest.mark.parametrize(
    ("scenario", "gait", "key", "limit"),
    [
        ("walk_flat", "tripod", "command.vx", 0.33),
        ("walk_flat", "amble", "command.vx", 0.19),
        ("turn", "tripod", "command.yaw_rate", 1.01),
    ],
)
def test_a_command_beyond_the_joints_is_walked_at_their_limit(
    scenario: str, gait: str, key: str, limit: float, friction: str
) -> None:
    given = ["control=compliant", f"gait.name={gait}", f"friction.law={friction}", "duration=5"]
    with Runner() as runner:
        results = [
            runner.simulate(load_scenario(scenario, overrides=[*given, f"{key}={share * limit}"]))
            for share in SHARES
        ]
    peaks = np.array([result.metrics["peak_force"] for result in results])
    assert (peaks < SOFT).all()
    assert np.abs(np.diff(peaks)).max() < 0.05  # no step at the limit
    for result, share in zip(results, SHARES, strict=True):
        recording = result.outcome.judged
        outrun = [f"controller.{leg}.outrun" for leg in ("LF", "LM", "LR", "RF", "RM", "RR")]
        assert recording.columns(outrun)[1:].any() == (share > 1.0)
        assert not recording.column("controller.LF.fallback").any()
    texts = [event["text"] for event in results[-1].facts.events]
    assert any("too fast for the joints of" in text for text in texts)
