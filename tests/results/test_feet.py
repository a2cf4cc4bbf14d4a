"""Tests the warning of feet that sink too deep, and the centres of the feet that foot
errors are computed from.
"""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.cosim.interface.names import foot_names, foot_vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.support import SLOPE, feet_of_angles, real_feet
from hexapod_cosim.cosim.results.warnings import sinkage_warnings
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import foot_positions, load_robot

COLUMNS = (*foot_names("sinkage"), *foot_names("contact"), *foot_vector_names("position"))


@pytest.mark.parametrize(
    ("pad", "depth", "said"),
    [
        (0.0, 0.015, ""),
        (0.0, 0.0365, "foot RM sinks too deep: got 36.5 mm at 2.000 s, expected at most the radius "
         "of its sphere, 15 mm; the soil's law counts the foot alone"),
        (0.025, 0.0249, ""),
        (0.03, 0.0365, "its pad, 30 mm"),
    ],
)  # fmt: skip
def test_a_foot_deeper_than_its_radius_is_warned_of(pad: float, depth: float, said: str) -> None:
    values = {name: np.zeros(4) for name in COLUMNS}
    values["LF.foot.sinkage"][1] = 0.5 * depth
    values["RM.foot.sinkage"][2] = depth
    recording = Recording(("time", *COLUMNS), np.column_stack([np.arange(4.0), *values.values()]))
    found = sinkage_warnings(recording, {"foot.radius": 0.015, "foot.pad_radius": pad})
    assert len(found) == bool(said)
    assert said in "".join(found)


@pytest.mark.usefixtures("plant_build")
def test_the_walk_on_sand_stays_above_its_pads_radius_and_a_sphere_does_not() -> None:
    for settings, warned in (([], False), (["foot.pad_radius=0"], True)):
        result = simulate(load_scenario("sand", overrides=["duration=3", *settings]))
        warnings = result.facts.warnings
        assert any("sinks too deep" in warning for warning in warnings) == warned


# The centres of the feet that foot errors are computed from, on planes and on surfaces.

NEEDS_FEET = pytest.mark.usefixtures("plant_build")

JOINTS = ("coxa", "femur", "tibia")
DRIFT = 1e-6  # m  of the joints' constraints in a walk


def walked(*overrides: str) -> Result:
    """Walks for some cycles."""
    return simulate(load_scenario("walk_flat", overrides=["duration=4", *overrides]))


@NEEDS_FEET
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


@NEEDS_FEET
def test_on_a_plane_both_ways_give_the_same_centres() -> None:
    for ground in ([], ["terrain.kind=slope", "terrain.incline=0.1", "terrain.heading=0.4"]):
        result = walked(*ground)
        centres = feet_of_angles(result.outcome.judged, result.parameters)
        assert np.abs(real_feet(result.outcome.judged, result.parameters) - centres).max() < DRIFT


@NEEDS_FEET
def test_on_a_surface_the_centres_are_a_radius_above_the_ground_along_its_normal() -> None:
    result = walked("terrain.kind=plane", "terrain.slope_x=0.1")
    recording, parameters = result.outcome.judged, result.parameters
    # the same ground as a slope, whose normal is known
    slope = {"terrain.kind": float(SLOPE), "terrain.incline": float(np.arctan(0.1))}
    known = real_feet(recording, {**parameters, **slope})
    assert np.abs(real_feet(recording, parameters) - known).max() < DRIFT
    upright = real_feet(recording, {**parameters, "terrain.kind": 1.0})
    assert np.abs(upright - known).max() > 1e-3  # what the vertical instead would give
