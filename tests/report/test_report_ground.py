"""Tests what a report shows of the ground: heights, the part around a walk, profile."""

from __future__ import annotations

import base64
import math
import zlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hexapod_cosim.cosim.interface.names import foot_names, foot_vector_names, vector_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.report.geometry import (
    MOST_NODES,
    describe_ground,
    material_legend,
    pack_surface,
)
from hexapod_cosim.cosim.report.payload import as_json
from hexapod_cosim.cosim.report.profile import make_profile
from hexapod_cosim.cosim.results.ground import around_walk, cut, describe_terrain
from hexapod_cosim.cosim.results.support import GRID
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.models import Terrain
from hexapod_cosim.models.ground.faces import ground_height, surface_heights
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import make_surface

ON_GRID = {"terrain.kind": float(GRID), "terrain.height": 0.0, "friction.mu": 0.7}
SPEED, STEP, ROWS = 0.1, 0.01, 601  # m/s, s: a torso that moves 0.6 m along x in 6 s
ROUND_OFF = 1e-12  # m
OVERSHOOT = 1e-6  # m    by which a smooth surface exceeds the range of its nodes, in steps
LARGEST = 120_000  # characters of 200 x 200 packed heights, all of them random


def unpacked(packed: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Returns the heights (rows, columns) [m] as the viewer reads them."""
    size = packed["rows"] * (len(packed["columns"]) + 2)
    planes = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"])), np.uint8)
    low, high = planes.reshape(2, size).astype(np.uint16)
    steps = (low + 256 * high).astype(np.uint16)[2 * packed["rows"] : 3 * packed["rows"]]
    name, scale, offset = packed["columns"][0]
    assert name == "height"
    heights = offset + scale * np.cumsum(steps, dtype=np.uint16).astype(np.float64)
    return np.asarray(heights.reshape(-1, packed["across"]))


def random_blocks(count: int) -> Surface:
    heights = np.random.default_rng(5).uniform(0.0, 0.05, (count, count))
    return Surface(kind="blocks", height=heights, x0=0.0, y0=0.0, cell=0.05)


def walked(*, rise: float = 0.0) -> View:
    """Returns a straight walk along x whose left front foot stands from 1 s to 2 s at x = 0.2."""
    time = STEP * np.arange(ROWS, dtype=np.float64)
    columns: dict[str, NDArray[np.float64]] = {
        name: np.zeros(ROWS) for name in ("time", "torso.yaw", *vector_names("torso.position"))
    }
    columns |= {
        name: np.zeros(ROWS) for name in (*foot_names("contact"), *foot_vector_names("position"))
    }
    columns["time"] = time
    columns["torso.position[1]"] = SPEED * time
    columns["torso.position[3]"] = 0.1 + rise * SPEED * time
    columns["LF.foot.contact"] = ((time >= 1.0) & (time < 2.0)).astype(float)
    columns["LF.foot.position[1]"] += 0.2
    columns["LF.foot.position[2]"] += 0.15
    columns["LF.foot.position[3]"] += rise * 0.2
    recording = Recording(tuple(columns), np.column_stack(list(columns.values())))
    return View(recording, ON_GRID, 1.0)


@pytest.mark.parametrize("name", ["rubble", "dune", "stairs", "course", "plane"])
def test_the_viewer_reads_heights_to_half_a_step(name: str) -> None:
    surface = make_surface(name, {})
    packed = pack_surface(surface, ON_GRID)
    shift = 0.5 if surface.kind == "blocks" else 0.0  # a block is known in its middle
    across = packed["across"]
    x, y = (
        packed[f"{axis}0"] + packed["cell"] * (np.arange(count) + shift)
        for axis, count in (("x", across), ("y", packed["rows"] // across))
    )
    error = np.abs(unpacked(packed) - surface_heights(surface, x, y)).max()
    assert error <= np.ptp(surface.height) / 131070 + OVERSHOOT
    assert packed["kind"] == surface.kind


def test_equal_heights_stay_equal_so_that_the_viewer_can_merge_faces() -> None:
    surface = make_surface("rubble", {})
    heights = unpacked(pack_surface(surface, ON_GRID))
    assert len(np.unique(heights)) == len(np.unique(surface.height))


def test_the_payload_of_a_surface_is_small() -> None:
    plane = pack_surface(make_surface("plane", {"slope_x": 0.1, "size": 10.0}), ON_GRID)
    assert len(as_json(plane)) < 3_000
    assert len(as_json(pack_surface(random_blocks(200), ON_GRID))) < LARGEST


def test_a_surface_of_too_many_heights_is_drawn_coarser() -> None:
    surface = random_blocks(1100)
    packed = pack_surface(surface, ON_GRID)
    assert packed["rows"] <= MOST_NODES
    assert packed["cell"] == pytest.approx(3 * surface.cell)


@pytest.mark.parametrize("name", ["random_uniform", "rubble", "wave"])
def test_a_part_of_a_surface_has_the_same_heights(name: str) -> None:
    whole = make_surface(name, {"size": 8.0})
    part = cut(whole, (-0.5, 1.0), (0.25, 0.75))
    assert part.height.size < whole.height.size
    for x, y in np.random.default_rng(1).uniform((-0.5, 0.25), (1.0, 0.75), (50, 2)).tolist():
        assert height(part, x, y) == pytest.approx(height(whole, x, y), abs=ROUND_OFF)


def height(surface: Surface, x: float, y: float) -> float:
    return ground_height(Terrain(kind="grid", height=0.0, surface=surface), x, y)


def test_the_part_around_a_walk_is_the_same_for_walks_that_differ_a_little() -> None:
    surface = make_surface("rubble", {"size": 30.0})
    one = around_walk(surface, walked().recording)
    other = walked().recording
    other = replace(other, data=other.data + 1e-3)
    assert around_walk(surface, other) == one
    assert one.height.size < surface.height.size / 4


def test_the_plane_of_a_surface_has_no_rise() -> None:
    ground = describe_ground(ON_GRID | {"terrain.height": 0.3, "terrain.incline": 0.2})
    assert ground == {"height": 0.3, "rise": 0.0, "heading": 0.0}


def test_the_profile_of_a_slope_is_a_line_under_the_path() -> None:
    profile = make_profile(walked(rise=0.1), make_surface("plane", {"slope_x": 0.1}))
    np.testing.assert_allclose(profile.ground, 0.1 * profile.way, atol=1e-9)
    assert profile.contact_way == pytest.approx([0.2])
    assert profile.contact_height == pytest.approx([0.02])


def test_the_text_of_the_ground_has_its_name_and_parameters() -> None:
    patches = [{"x": 0.5, "y": 0.0, "size": 0.4, "mu": 0.3}]
    surface = make_surface("stairs", {"step_height": 0.03, "num_steps": 4, "patch": patches})
    assert describe_terrain(surface, ON_GRID) == (
        "stairs (step_height = 0.03 m, num_steps = 4, 1 patch, heights from 0 to 120 mm)"
    )
    assert describe_terrain(None, {"terrain.kind": 1.0}) == "level plane"
    slope = {"terrain.kind": 2.0, "terrain.incline": math.radians(5.0)}
    assert describe_terrain(None, slope) == "plane with a slope of 5 deg"


def test_the_legend_names_soil_and_friction_of_patches() -> None:
    patches = [
        {"x": 0.5, "y": 0.0, "size": 0.4, "mu": 0.3},
        {"x": -0.5, "y": 0.0, "size": 0.4, "mu": 0.9, "stiffness": 2e4},
        {"x": 1.5, "y": 0.0, "size": 0.4, "soil": "dry_sand"},
    ]
    legend = material_legend(make_surface("plane", {"patch": patches}), ON_GRID)
    assert [entry["look"] for entry in legend] == ["slippery", "patch", "soil"]
    assert [entry["text"] for entry in legend] == [
        "mu 0.3",
        "mu 0.9, stiffness 2e+04 N/m^1.5",
        "soil",
    ]
