"""The centres of the feet that foot errors are computed from, on planes and on surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.cosim.results.feet import feet_of_angles
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.window import SLOPE, real_feet
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import foot_positions, load_robot

pytestmark = pytest.mark.usefixtures("plant_build")

JOINTS = ("coxa", "femur", "tibia")
DRIFT = 1e-6  # m  of the joints' constraints in a walk


def walked(*overrides: str) -> Result:
    """Walks for some cycles."""
    return simulate(load_scenario("walk_flat", overrides=["duration=4", *overrides]))


def test_centres_from_angles_are_the_kinematics_of_the_robot() -> None:
    result = walked()
    robot, recording = load_robot("athena"), result.outcome.judged
    centres = feet_of_angles(recording, result.parameters)
    for row in (0, 250, 700):
        angle = np.array(
            [
                [recording.column(f"{leg.name}.{joint}.angle")[row] for joint in JOINTS]
                for leg in robot.legs
            ]
        )
        assert centres[row] == pytest.approx(foot_positions(robot, angle), abs=1e-14)


def test_on_a_plane_both_ways_give_the_same_centres() -> None:
    for ground in ([], ["terrain.kind=slope", "terrain.incline=0.1", "terrain.heading=0.4"]):
        result = walked(*ground)
        centres = feet_of_angles(result.outcome.judged, result.parameters)
        assert np.abs(real_feet(result.outcome.judged, result.parameters) - centres).max() < DRIFT


def test_on_a_surface_the_centres_are_a_radius_above_the_ground_along_its_normal() -> None:
    result = walked("terrain.kind=plane", "terrain.slope_x=0.1")
    recording, parameters = result.outcome.judged, result.parameters
    # the same ground as a slope, whose normal is known
    slope = {"terrain.kind": float(SLOPE), "terrain.incline": float(np.arctan(0.1))}
    known = real_feet(recording, {**parameters, **slope})
    assert np.abs(real_feet(recording, parameters) - known).max() < DRIFT
    upright = real_feet(recording, {**parameters, "terrain.kind": 1.0})
    assert np.abs(upright - known).max() > 1e-3  # what the vertical instead would give
