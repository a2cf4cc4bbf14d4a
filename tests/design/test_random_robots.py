"""Gains are designed for robots of all sizes, and all of them walk.

Some robots are tested here, all 30 with `make test-robots`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median

import pytest
from random_robots import COUNT, draw_robot, hip_height, walk_of
from scaled_robots import scaled_robot

from hexapod_cosim.cosim.design.gains import design_for
from hexapod_cosim.cosim.results.summary import Summary
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.scenario.records import Scenario
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.urdf.writer import robot_to_urdf

ALL = os.environ.get("HEXAPOD_ROBOTS") == "all"
# 1: rests late; 4: its margins lie at a resonance; 7: under 1 kg, light loads used to tip it
NUMBERS = range(COUNT) if ALL else (1, 4, 7)
pytestmark = pytest.mark.usefixtures("plant_build")


@pytest.fixture(scope="module")
def walks() -> Iterator[dict[str, tuple[Summary, Summary]]]:
    """Collects the summaries of the walks by robot, for the printed result."""
    found: dict[str, tuple[Summary, Summary]] = {}
    yield found
    if not found:
        return
    slips = [[one.metrics["slip_per_metre"] for one in pair] for pair in found.values()]
    shares = [compliant / kinematic for kinematic, compliant in slips]
    print(
        f"\n{sum(compliant.walked for _, compliant in found.values())} of {len(found)} robots "
        "walk under compliant control; slip, compliant over kinematic: "
        f"median {median(shares):.3f}, {min(shares):.3f} to {max(shares):.3f}"
    )


def walk(robot: Robot, scenario: Scenario, walks: dict[str, tuple[Summary, Summary]]) -> Summary:
    """Designs for a robot and runs it under compliant and, for comparison, kinematic control."""
    gains = design_for(robot, scenario.macro_step)
    with Runner() as runner:
        kinematic, compliant = (
            runner.summary(replace(scenario, control=name), gains=gains)
            for name in ("kinematic", "compliant")
        )
    walks[robot.name] = kinematic, compliant
    print(
        f"\n{robot.name}: {robot.total_mass:.2f} kg, "
        f"hips {1000.0 * hip_height(robot):.0f} mm high, share {gains.paper.share:.3g}, "
        + ", ".join(
            f"{name} {kinematic.metrics[key]:.3g} -> {compliant.metrics[key]:.3g}"
            for name, key in (
                ("slip [m/m]", "slip_per_metre"),
                ("path error [m/m]", "path_error"),
                ("peak force [BW]", "peak_force"),
            )
        )
    )
    return compliant


def assert_walks(compliant: Summary, kinematic: Summary) -> None:
    assert compliant.walked, compliant.reason
    assert compliant.fallback == 0.0
    assert compliant.metrics["path_error"] < 0.02  # of the way commanded
    assert compliant.metrics["slip_per_metre"] < kinematic.metrics["slip_per_metre"]


@pytest.mark.parametrize("number", NUMBERS)
def test_a_robot_drawn_at_random_is_designed_for_and_walks(
    number: int, tmp_path: Path, walks: dict[str, tuple[Summary, Summary]]
) -> None:
    path, robot = draw_robot(number, tmp_path)
    compliant = walk(robot, walk_of(robot, path, "compliant"), walks)
    assert compliant.warnings == ()
    assert_walks(compliant, walks[robot.name][0])


def odd_robots() -> list[Robot]:
    """Returns robots with the torso's mass 15 cm off the centre, and of two more sizes."""
    robot = load_robot("athena")
    front, side = (replace(robot.torso, com=com) for com in ((0.15, 0.0, 0.0), (0.0, 0.15, 0.0)))
    odd = [replace(robot, name="heavy_in_front", torso=front), scaled_robot(robot, 0.5)]
    return (
        [*odd, replace(robot, name="heavy_on_the_left", torso=side), scaled_robot(robot, 2.0)]
        if ALL
        else odd
    )


@pytest.mark.parametrize("robot", odd_robots(), ids=lambda robot: robot.name)
def test_an_odd_robot_walks(
    robot: Robot, tmp_path: Path, walks: dict[str, tuple[Summary, Summary]]
) -> None:
    path = tmp_path / f"{robot.name}.urdf"
    path.write_text(robot_to_urdf(robot), encoding="utf-8")
    assert_walks(walk(robot, walk_of(robot, path, "compliant"), walks), walks[robot.name][0])
