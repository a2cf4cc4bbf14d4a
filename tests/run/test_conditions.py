"""Runs under unusual conditions: ground without friction, a start in the air, other gravities."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hexapod_cosim.controller import GainsError
from hexapod_cosim.cosim.design.gains import design_for
from hexapod_cosim.cosim.export.robot_package import read_values
from hexapod_cosim.cosim.interface.controller import controller_parameters
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.run.plan import make_plan
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import HexapodError, load_robot

NO_PUSH = "the ground has no friction: feet cannot push, and the robot does not get ahead"


def run(name: str, *overrides: str) -> Result:
    with Runner(everything=True) as runner:
        result = runner.simulate(load_scenario(name, overrides=overrides))
    assert result.completed, result.outcome.reason
    return result


@pytest.mark.parametrize("friction", ["friction.mu=0", "friction.law=none"])
def test_a_robot_on_ice_walks_on_the_spot_and_is_warned_why(
    plant_build: Path, friction: str
) -> None:
    result = run("walk_flat", friction, "duration=2")
    position = result.outcome.recording.vector("torso.position")
    # m: of 0.12 commanded; its legs swing its torso to and fro
    assert float(np.abs(position[:, :2] - position[0, :2]).max()) < 0.01
    assert NO_PUSH in result.facts.warnings
    assert result.facts.walk.upright


def test_a_robot_on_an_icy_slope_slides_at_the_gravity_along_it_and_is_warned(
    plant_build: Path,
) -> None:
    """From rest, the way along the slope is 1/2 g sin(a) t^2 with a = 0.1 rad.

    That is 0.4897 m in a second, whatever the legs do.
    """
    result = run(
        "stand", "terrain.kind=slope", "terrain.incline=0.1", "friction.mu=0", "duration=1"
    )
    position = result.outcome.recording.vector("torso.position")
    assert float(np.linalg.norm(position[-1] - position[0])) == pytest.approx(0.48968, abs=1e-4)
    assert position[-1, 0] < position[0, 0]
    assert (
        "the robot slides: the ground's slope pulls it downhill at 0.979 m/s2, without friction"
        in result.facts.warnings
    )
    assert result.facts.walk.upright


def test_gains_are_not_designed_for_feet_without_friction(plant_build: Path) -> None:
    robot = load_robot("athena")
    icy = replace(robot, friction=replace(robot.friction, mu=0.0))
    with pytest.raises(
        GainsError, match=r"answers to the feet's friction: got 'friction law tanh, mu 0\.0'"
    ):
        design_for(icy, 0.005)


def test_a_robot_dropped_from_a_metre_lands_on_its_feet_and_has_not_fallen(
    plant_build: Path,
) -> None:
    result = run("stand", "initial.position[3]=1", "duration=2")
    assert result.facts.walk.upright
    recording = result.outcome.recording
    landed = recording.time[np.argmax((recording.feet("contact") > 0.5).any(axis=1))]
    # s    to a macro-step; it stands at 0.132 m
    assert landed == pytest.approx((2.0 * (1.0 - 0.132) / 9.81) ** 0.5, abs=0.006)
    assert recording.column("torso.position[3]")[-1] == pytest.approx(0.1317, abs=1e-3)


def test_a_robot_dropped_on_its_side_has_fallen(plant_build: Path) -> None:
    result = run(
        "stand",
        "initial.position[3]=0.5",
        "initial.quaternion[1]=0.8",
        "initial.quaternion[2]=0.6",
        "duration=1",
    )
    assert not result.facts.walk.upright


def test_a_kinematic_drive_follows_the_walk_within_a_third_of_a_milliradian(
    plant_build: Path,
) -> None:
    """The error is measured at the ends of macro-steps.

    Without acceleration_ref the lag would be 20 mrad, the acceleration over beta^2.
    """
    recording = run("walk_flat", "servo.mode=kinematic", "duration=4").outcome.recording
    angle, wanted, acceleration = (
        recording.joints(name)[400:-1] for name in ("angle", "angle_ref", "acceleration_ref")
    )
    assert float(np.abs(angle - wanted).max()) < 3.3e-4  # rad
    assert float(np.abs(acceleration).max()) / 2500.0 > 0.015  # rad    beta = 50/s


WORLDS = {"moon": 1.62, "mars": 3.71}


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("control", ["kinematic", "compliant"])
def test_the_robot_walks_under_other_gravities(plant_build: Path, world: str, control: str) -> None:
    """The tripod's Froude number v^2/(g h) is 0.03 on the moon, so it needs no scaling.

    The start is settled, and the weight is m g.
    """
    result = run(world, f"control={control}", "gait.name=tripod", "duration=4")
    recording, walk = result.outcome.recording, result.facts.walk
    weight = 5.6 * WORLDS[world]  # N    5.6 kg
    assert float(recording.feet("normal_force")[0].sum()) == pytest.approx(weight, rel=1e-5)
    assert float(recording.feet("normal_force")[400:].sum(axis=1).mean()) == pytest.approx(
        weight, rel=0.01
    )
    assert walk.upright
    assert walk.distance == pytest.approx(0.16, rel=0.05)  # m    two seconds at 0.08 m/s
    assert (walk.fallback or 0.0) == 0.0
    assert result.metrics["path_error"] < (0.005 if control == "compliant" else 0.05)
    if (
        control == "compliant"
        # a controller that plans for 9.81 m/s2 stamps with 2.4 body weights on the moon and 1.1 on
        # Mars
    ):
        assert result.metrics["peak_force"] < 0.7


def test_the_controllers_fmu_gets_the_scenarios_gravity() -> None:
    setup = make_plan(load_scenario("moon")).controller
    parameters = controller_parameters(setup)
    assert [parameters[f"gravity[{k}]"] for k in (1, 2, 3)] == [0.0, 0.0, -1.62]


@pytest.mark.parametrize("name", ["plant.gravity[3]", "controller.gravity[3]"])
def test_a_packages_gravity_is_not_that_of_one_component(name: str) -> None:
    with pytest.raises(
        HexapodError,
        match=r"gravity of one component alone: .* "
        r"write gravity = \[0, 0, -1\.62\] into the robot's file",
    ):
        read_values([f"{name}=-1.62"])


# the paper's law corrects no path, so that a torso which turned while it tipped stays turned
@pytest.mark.parametrize(
    ("control", "path_error", "peak"), [("compliant", 0.05, 0.8), ("paper", 0.08, 1.2)]
)
def test_a_robot_that_loses_a_leg_walks_on_at_its_pace_and_takes_the_leg_back(
    control: str, path_error: float, peak: float
) -> None:
    with Runner() as runner:
        result = runner.simulate(load_scenario("lost_leg", overrides=[f"control={control}"]))
    recording = result.outcome.judged
    gone = recording.time[recording.column("controller.LM.absent") > 0.5]
    assert 4.0 < gone[0] < 5.5  # the leg is lost at 4 s; a gait cycle takes 1.5 s
    assert 10.2 < gone[-1] < 12.5  # it works again at 9 s
    assert not recording.column("controller.RM.absent").any()
    texts = [event["text"] for event in result.facts.events]
    assert texts.index("the controller walks without LM") < texts.index(
        "the controller walks with LM again"
    )
    place = recording.column("torso.position[1]")
    pace = (np.interp(9.0, recording.time, place) - np.interp(7.0, recording.time, place)) / 2.0
    assert pace == pytest.approx(0.08, rel=0.1)
    assert result.metrics["path_error"] < path_error
    assert result.metrics["peak_force"] < peak  # body weights
    assert result.facts.walk.fallback == 0.0
    assert result.facts.walk.upright
