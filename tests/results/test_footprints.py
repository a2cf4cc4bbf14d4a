"""Tests the footprints that reports draw, and the centres of the feet that foot
errors are computed from.
"""

from __future__ import annotations

import ctypes as ct
import math
from dataclasses import replace

import numpy as np
import pytest
from plant import Plant, pointer
from states import changed

from hexapod_cosim.cosim.interface.names import foot_names, foot_vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.footprints import find_footprints, sinkage_warnings
from hexapod_cosim.cosim.results.support import SLOPE, feet_of_angles, real_feet
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.models import foot_positions, load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.records import Array
from hexapod_cosim.models.soil.presets import soil_preset
from hexapod_cosim.models.statics import standing

STEP = 0.005  # s
SLIPPED = 2e-3  # m  that a foot may slip between its last row in contact and its lift-off
COLUMNS = (*foot_names("sinkage"), *foot_names("contact"), *foot_vector_names("position"))


def stepped(plant: Plant, duration: float) -> Recording:
    """Steps through a motion that lifts the legs in two groups; returns its recording."""
    robot, group, rows = plant.robot, np.arange(6) % 2, []
    for k in range(round(duration / STEP)):
        phase = 2.0 * np.pi * k * STEP + np.pi * group
        angle = robot.stance.copy()
        angle[:, 0] += 0.2 * np.cos(phase) * np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])
        angle[:, 1] += 0.35 * np.maximum(np.sin(phase), 0.0)
        plant.step((k + 1) * STEP, Command(angle_ref=angle))
        foot = plant.output().foot
        rows.append([plant.time, *foot.sinkage, *foot.contact, *np.ravel(foot.position)])
    return Recording(("time", *COLUMNS), np.array(rows))


def kept(plant: Plant) -> Array:
    """Returns x, y, depth and radius (n, 4) of the plant's footprints [m]."""
    plant.core.hx_plant_footprints.restype = ct.c_size_t
    plant.core.hx_plant_footprints.argtypes = None
    found = np.zeros((512, 4))
    place = pointer(found)
    number = plant.core.hx_plant_footprints(ct.c_void_p(plant.handle), place, ct.c_size_t(512))
    return found[:number]


def test_footprints_of_a_recording_are_those_of_the_plant(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), foot={"pad_radius": 0.025})
    robot = replace(robot, soil=soil_preset("dry_sand").soil)
    pose = standing(robot)
    plant = Plant(core, robot, position=pose.position, angle=pose.angle)
    recording = stepped(plant, 2.6)
    found = [
        one
        for one in find_footprints(recording, {"foot.radius": 0.015, "foot.pad_radius": 0.025})
        if one.end == math.inf
    ]
    true = kept(plant)
    assert 12 <= len(true) <= len(found) <= len(true) + 6  # feet stand in the latest ones
    for x, y, depth, radius in true:
        nearest = min(found, key=lambda one: abs(one.depth - depth))
        assert nearest.depth == depth
        assert np.hypot(nearest.x - x, nearest.y - y) < SLIPPED
        assert nearest.radius == radius


def test_a_foot_that_stays_below_the_surface_takes_its_footprint_along() -> None:
    values = {name: np.zeros(6) for name in COLUMNS}
    values["LF.foot.sinkage"][:] = 0.01, 0.01, 0.01, 0.012, 0.012, 0.0
    values["LF.foot.contact"][:] = 1.0, 1.0, 0.0, 1.0, 0.0, 0.0
    values["LF.foot.position[1]"][:] = 0.1, 0.11, 0.2, 0.3, 0.4, 0.5
    recording = Recording(("time", *COLUMNS), np.column_stack([np.arange(6.0), *values.values()]))
    first, second = find_footprints(recording, {"foot.radius": 0.015})
    assert (first.begin, first.end, first.x, first.depth) == (0.0, 3.0, 0.11, 0.01)
    assert (second.begin, second.end, second.x, second.depth) == (3.0, math.inf, 0.3, 0.012)


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
