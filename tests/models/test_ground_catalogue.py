"""Tests the catalogue of surfaces: shapes, determinism, parameters, patches, robot files."""

from __future__ import annotations

import math
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexapod_cosim.models import RobotError, load_robot, robot_from_table
from hexapod_cosim.models.ground.faces import ground_height
from hexapod_cosim.models.ground.grid_file import (
    HEADER,
    grid_bytes,
    read_grid,
    surface_from_bytes,
    write_grid,
)
from hexapod_cosim.models.ground.smooth import height_and_slopes, heights_at
from hexapod_cosim.models.ground.surface import Surface, Terrain
from hexapod_cosim.models.ground.table import CATALOGUE, make_surface, merged_terrain, terrain_table
from hexapod_cosim.models.urdf.writer import robot_to_urdf

MADE = [name for name in CATALOGUE if name != "heightfield"]
ATHENA = Path(__file__).resolve().parents[2] / "models" / "athena.toml"
PLATFORM = 0.4  # m    half of the default platform


def on_grid(surface: Surface) -> Terrain:
    return Terrain(kind="grid", surface=surface)


def table_with(terrain: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the tables of athena.toml with another [terrain]."""
    return tomllib.loads(ATHENA.read_text(encoding="utf-8")) | {"terrain": dict(terrain)}


@pytest.mark.parametrize("name", MADE)
def test_a_surface_is_flat_around_the_start(name: str) -> None:
    terrain = on_grid(make_surface(name, {}))
    generator = np.random.default_rng(1)
    for x, y in generator.uniform(-PLATFORM + 1e-9, PLATFORM - 1e-9, (100, 2)):
        assert ground_height(terrain, x, y) == 0.0


@pytest.mark.parametrize("name", MADE)
def test_a_grid_file_gives_the_surface_back(name: str, tmp_path: Path) -> None:
    patch = {"x": 0.5, "y": 0.2, "size": 0.4, "mu": 0.2}
    for surface in (make_surface(name, {}), make_surface(name, {"patch": [patch]})):
        again = read_grid(write_grid(surface, tmp_path / "1.terrain"))
        assert again == surface
        assert again.digest == surface.digest
        assert again.name == surface.name
        assert grid_bytes(again) == grid_bytes(surface)


def test_the_grid_file_has_the_fields_of_its_format() -> None:
    surface = Surface(
        kind="blocks",
        height=np.array([[0.0, 0.25, 0.5]]),
        x0=-1.0,
        y0=2.0,
        cell=0.5,
        name="three",
        material=np.array([[0, 1, 0]], dtype=np.uint8),
        materials=np.arange(16.0)[None, :],
    )
    content = grid_bytes(surface)
    assert HEADER.size == 128
    assert content[:8] == b"hxGrid01"
    assert np.frombuffer(content, "<i8", 4, 8).tolist() == [1, 3, 2, 1]
    assert np.frombuffer(content, "<f8", 3, 40).tolist() == [-1.0, 2.0, 0.5]
    assert content[64:128] == b"three" + bytes(59)
    assert np.frombuffer(content, "<f8", 3, 128).tolist() == [0.0, 0.25, 0.5]
    assert content[152:160] == bytes([0, 1, 0, 0, 0, 0, 0, 0])
    assert np.frombuffer(content, "<f8", 16, 160).tolist() == list(range(16))
    assert len(content) == 288


@pytest.mark.parametrize(
    "damage", [lambda c: c[:100], lambda c: c[:-8], lambda c: b"hxGrid02" + c[8:], lambda c: b""]
)
def test_a_damaged_grid_file_is_refused(damage: Any) -> None:
    content = grid_bytes(make_surface("stairs", {}))
    with pytest.raises(RobotError, match="not a grid file"):
        surface_from_bytes(damage(content))


def test_equal_parameters_give_equal_bits_in_another_process() -> None:
    code = (
        "from hexapod_cosim.models.ground.table import CATALOGUE, make_surface;"
        "print(*(make_surface(n, {}).digest for n in CATALOGUE if n != 'heightfield'))"
    )
    again = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert again == [make_surface(name, {}).digest for name in MADE]


def test_stairs_have_the_height_and_the_tread_that_are_asked_for() -> None:
    terrain = on_grid(make_surface("stairs", {"step_height": 0.03, "step_width": 0.17}))
    begin = 0.17 / 3.0 * math.ceil(PLATFORM / (0.17 / 3.0))  # a whole number of blocks
    for step in range(5):
        edge = begin + 0.17 * step
        assert ground_height(terrain, edge - 1e-9, 0.0) == pytest.approx(0.03 * step)
        assert ground_height(terrain, edge + 1e-9, 0.0) == pytest.approx(0.03 * (step + 1))
    assert ground_height(terrain, 1.9, 1.0) == pytest.approx(0.15)


def test_a_ramp_has_its_slope() -> None:
    ramp = on_grid(make_surface("ramp", {"slope": 0.2}))
    assert ground_height(ramp, 0.9, 0.3) - ground_height(ramp, 0.7, 0.3) == pytest.approx(0.04)


def test_a_wave_has_its_amplitude_and_its_length() -> None:
    surface = make_surface("wave", {"amplitude": 0.04, "num_waves": 4, "horizontal_scale": 0.025})
    assert height_and_slopes(surface, 1.25, 1.25)[0] == pytest.approx(0.04, abs=1e-6)
    assert height_and_slopes(surface, 1.75, 1.75)[0] == pytest.approx(-0.04, abs=1e-6)


def test_difficulty_raises_what_is_not_given() -> None:
    def height(**given: float) -> float:
        return float(make_surface("step_up", given).height.max())

    assert height(difficulty=0.0) == pytest.approx(0.025)
    assert height(difficulty=1.0) == pytest.approx(0.115)
    assert height(difficulty=1.0, step_height=0.02) == pytest.approx(0.02)


def test_random_heights_are_multiples_of_the_vertical_scale() -> None:
    surface = make_surface("rubble", {"vertical_scale": 0.004, "max_height": 0.04})
    levels = surface.height / 0.004
    assert np.max(np.abs(levels - np.round(levels))) < 1e-12
    assert 0.0 <= surface.height.min() < surface.height.max() <= 0.04


def test_the_heights_of_a_picture_are_those_of_the_points() -> None:
    surface = make_surface("random_uniform", {})
    x, y = np.linspace(-2.2, 2.2, 23), np.linspace(-2.0, 2.0, 17)
    expected = [[height_and_slopes(surface, u, v)[0] for u in x] for v in y]
    assert heights_at(surface, x, y) == pytest.approx(np.array(expected), abs=1e-15)


REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("staris", {}, "did you mean 'stairs'"),
    ("stairs", {"step_hight": 0.1}, "did you mean 'step_height'"),
    ("stairs", {"step_height": -0.1}, r"> 0 and <= 100 \[m\]"),
    ("rubble", {"seed": 1.5}, "whole number"),
    ("rubble", {"size": 100.0, "horizontal_scale": 0.002}, "do not fit together"),
    ("rubble", {"patch": {"x": 0}}, "two brackets"),
    ("rubble", {"patch": [{"x": 0.0, "y": 0.0, "mu": 0.1}]}, "size"),
    ("rubble", {"patch": [{"x": 0.0, "y": 0.0, "size": 1.0}]}, "mu, mu_static, stiffness, soil"),
    ("rubble", {"patch": [{"x": 1.9, "y": 0.0, "size": 1.0, "mu": 0.1}]}, "leaves the map"),
    ("rubble", {"patch": [{"x": 0.0, "y": 0.0, "size": 0.01, "mu": 0.1}]}, "smaller than"),
    ("rubble", {"patch": [{"x": 0.0, "y": 0.0, "size": 1.0, "soil": "dry_send"}]}, "'dry_sand'"),
    ("sand", {"soil": "moon"}, "unknown soil"),
    ("heightfield", {}, "file"),
]


@pytest.mark.parametrize(("name", "given", "message"), REFUSED)
def test_an_impossible_surface_is_refused(name: str, given: dict[str, Any], message: str) -> None:
    with pytest.raises(RobotError, match=message):
        make_surface(name, given)


@pytest.mark.parametrize(
    ("name", "soil", "columns"),
    [("rubble", {}, [1e5, 0.0, 0.0]), ("wave", {"soil": "dry_sand"}, [1e5, 1.0, 1528430.0])],
)
def test_a_patch_is_where_it_is_put(name: str, soil: dict[str, str], columns: list[float]) -> None:
    patches = [
        {"x": 0.5, "y": 0.0, "size": [0.6, 1.0], "mu": 0.2},
        {"x": 0.5, "y": 0.0, "size": 0.2, "stiffness": 1e5} | soil,
    ]
    surface = make_surface(name, {"patch": patches})
    found = [surface.material_at(x, 0.0) for x in (0.1, 0.3, 0.5, 0.7, 0.9)]
    assert found == [0, 1, 2, 1, 0]
    assert surface.material_at(0.5, 0.4) == 1
    assert surface.materials is not None
    assert surface.materials[0, 0] == 0.2
    assert np.isnan(surface.materials[0, 1:3]).all()
    assert surface.materials[0, 3] == 0.0
    assert surface.materials[1, 2:5] == pytest.approx(columns)


def test_a_robot_file_may_name_a_surface() -> None:
    given = {"kind": "stairs", "step_height": 0.03, "height": 0.1}
    robot = robot_from_table(table_with(given), where="test")
    assert robot.terrain.kind == "grid"
    assert robot.terrain.name == "stairs"
    assert robot.terrain.surface == make_surface("stairs", {"step_height": 0.03})
    flat = load_robot("athena")
    assert robot.hash != flat.hash
    other = robot_from_table(table_with(given | {"step_height": 0.031}), where="test")
    assert len({robot.hash, other.hash, flat.hash}) == 3
    assert robot.terrain.surface is not None
    named = replace(robot.terrain, surface=replace(robot.terrain.surface, name="other"))
    assert replace(robot, terrain=named).hash == robot.hash


BAD_TABLES: list[tuple[dict[str, Any], str]] = [
    ({"kind": "grid"}, "unknown surface"),
    ({"height": 0.0}, "one of flat, slope, stairs"),
    ({"kind": "flat", "step_height": 0.1}, "step_height"),
    ({"kind": "flat", "patch": [{"x": 0, "y": 0, "size": 1, "mu": 0.1}]}, 'kind = "plane"'),
    ({"kind": "rubble", "horizontal_scale": 0.01}, "blocks narrower than a foot"),
    ({"kind": "random_uniform", "horizontal_scale": 0.03}, "valleys narrower than a foot"),
    ({"kind": "wave", "incline": 2.0}, "incline"),
]


@pytest.mark.parametrize(("terrain", "message"), BAD_TABLES)
def test_an_impossible_ground_is_refused(terrain: dict[str, Any], message: str) -> None:
    with pytest.raises(RobotError, match=message):
        robot_from_table(table_with(terrain), where="test")


def test_a_scenario_changes_parameters_of_the_robots_own_surface() -> None:
    own = robot_from_table(table_with({"kind": "stairs", "step_height": 0.03}), where="t").terrain
    wider = merged_terrain(own, {"step_width": 0.2}, "terrain")
    assert wider.surface == make_surface("stairs", {"step_height": 0.03, "step_width": 0.2})
    other = merged_terrain(own, {"kind": "step_up"}, "terrain")
    assert other.surface == make_surface("step_up", {})
    flat = merged_terrain(own, {"kind": "flat"}, "terrain")
    assert (flat.kind, flat.surface) == ("flat", None)
    with pytest.raises(RobotError, match="seed"):
        merged_terrain(own, {"seed": 1}, "terrain")


def test_a_urdf_and_a_table_give_the_ground_back(tmp_path: Path) -> None:
    patch = {"x": 0.5, "y": 0.0, "size": [0.6, 1.0], "mu": 0.2, "soil": "clay"}
    given = {"kind": "random_uniform", "seed": 4, "height": 0.1, "patch": [patch]}
    robot = robot_from_table(table_with(given), where="test")
    path = tmp_path / "robot.urdf"
    path.write_text(robot_to_urdf(robot), encoding="utf-8")
    assert load_robot(path) == robot
    assert load_robot(path).hash == robot.hash
    table = terrain_table(robot.terrain)
    assert robot_from_table(table_with(table), where="test").terrain == robot.terrain


def test_a_patch_of_soil_on_blocks_is_refused() -> None:
    patch = {"x": 0.0, "y": 0.0, "size": 1.0, "soil": "dry_sand"}
    with pytest.raises(RobotError, match=r"soil on blocks.*rubble.*smooth"):
        robot_from_table(table_with({"kind": "rubble", "patch": [patch]}), where="test")
