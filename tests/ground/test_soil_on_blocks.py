"""Soil on blocks with edges: tops are soft, walls and edges rigid, and a foot in its print keeps
its block until it has left the print upwards. Energy books, the twin, prints, bodies.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from grids import Ground, start_on_grid
from plant import Plant
from states import changed
from test_grid_motion import march
from test_twin_motion import Pair, stood

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.footprints import footprint_depth
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import make_surface
from hexapod_cosim.models.kinematics import foot_centres
from hexapod_cosim.models.records import Array, Terrain
from hexapod_cosim.models.soil.presets import soil_preset
from hexapod_cosim.models.validation.bodies import check_settings

ATHENA = changed(load_robot("athena"), body={"contact": "off"})
TERRAINS: dict[str, dict[str, Any]] = {
    "stairs": {"step_height": 0.03, "platform_size": 0.3},
    "rubble": {"max_height": 0.03, "stone_size": 0.15, "platform_size": 0.3},
    "stepping_stones": {"stone_distance": 0.05, "depth": 0.04, "platform_size": 0.3},
}
BOOKS = 1e-3  # of the motors' gross work, as on level soil
EDGE = 0.03  # m  height of the step of `nose`


def soft(robot: Robot, soil: str, pad: float) -> Robot:
    return replace(changed(robot, foot={"pad_radius": pad}), soil=soil_preset(soil).soil)


def on(surface: Surface, robot: Robot) -> Robot:
    return replace(robot, terrain=Terrain(kind="grid", surface=surface))


def put(core: ct.CDLL, robot: Robot, height: float = 0.002) -> tuple[Plant, Ground]:
    """Returns the plant in its pose of rest, raised by a height [m], and its ground."""
    assert robot.terrain.surface is not None
    ground = Ground(core, grid_bytes(robot.terrain.surface))
    plant = Plant(core, changed(robot, terrain={"kind": "flat"}))
    start_on_grid(plant, ground, position=(0.0, 0.0, 0.5))
    plant.bodies = stood(robot, height=height)
    return plant, ground


def gross(out: Any) -> float:
    return float(out.positive_work.sum() + out.negative_work.sum())


@pytest.mark.parametrize("pad", [0.0, 0.025])
@pytest.mark.parametrize("soil", ["dry_sand", "mud"])
@pytest.mark.parametrize("name", list(TERRAINS))
def test_the_energy_books_of_a_march_close(core: ct.CDLL, name: str, soil: str, pad: float) -> None:
    """Beside the platform, feet update_footprints on tops and noses and are dragged along walls."""
    robot = on(make_surface(name, TERRAINS[name]), soft(ATHENA, soil, pad))
    check_settings(robot)
    plant, _ground = put(core, robot)
    march(plant, 2.0)
    out = plant.output()
    assert out.footprints >= 3
    assert abs(out.energy.residual) < BOOKS * gross(out)


def nose(robot: Robot, before: float, height: float = EDGE) -> Surface:
    """Returns blocks of 0.1 m that fall by a height [m] at a way [m] before the front feet."""
    edge = float(foot_centres(robot, stood(robot))[0, 0]) + before
    heights = np.zeros((40, 40))
    heights[:, 20:] = -height
    return Surface(kind="blocks", height=heights, x0=edge - 2.0, y0=-1.97, cell=0.1)


def pushed(robot: Robot, *shares: float) -> Command:
    return Command(angle_ref=robot.stance, push_force=np.multiply(shares, robot.weight))


@pytest.mark.parametrize("pad", [0.0, 0.025])
def test_a_sunken_foot_that_is_dragged_over_the_nose_of_its_block_gets_no_energy(
    core: ct.CDLL, pad: float
) -> None:
    bare = soft(changed(ATHENA, friction={"mu": 0.1}), "dry_sand", pad)
    robot = on(nose(bare, 0.004), bare)
    plant, _ground = put(core, robot)
    first = plant.output().foot.position[0, 0]
    for k in range(100):
        plant.step(0.01 * (k + 1), pushed(robot, 0.75 if k > 30 else 0.0, 0.0, 0.0))
    out = plant.output()
    assert out.foot.position[0, 0] > first + 0.008
    assert out.foot.sinkage[0] > 0.002
    assert abs(out.energy.residual) < BOOKS * out.energy.dissipated


@pytest.mark.parametrize("pad", [0.0, 0.025])
def test_feet_that_land_beside_and_on_a_nose_of_soil_move_as_the_twins(
    core: ct.CDLL, pad: float
) -> None:
    """Two feet land behind the nose and are pushed over it, the others stand on the block."""
    bare = soft(changed(ATHENA, friction={"mu": 0.3}), "dry_sand", pad)
    robot = on(nose(bare, 0.003), bare)
    pair = Pair(core, robot, stood(robot, height=0.001, velocity=(0.5, 0.0, -0.3)))
    pair.move(0.03, lambda _: pushed(robot, 1.0, 0.0, -0.5))
    pair.assert_same(scale=10.0)
    assert pair.state.contacts.plastic.max() > 1e-3
    pair.move(0.06, lambda _: pushed(robot, 1.0, 0.0, 1.5))
    pair.assert_same(scale=10.0)


def test_a_print_counts_on_its_own_level_alone() -> None:
    prints = np.array([[0.04, 0.0, 0.02, 0.03]])
    heights = np.array([[0.0, -0.05], [0.0, -0.05]])
    surface = Surface(kind="blocks", height=heights, x0=-0.05, y0=-0.05, cell=0.1)
    assert footprint_depth(prints, np.array([0.045, 0.0, 0.0]), surface) == 0.02
    assert footprint_depth(prints, np.array([0.055, 0.0, 0.0]), surface) == 0.0
    assert footprint_depth(prints, np.array([0.055, 0.0, 0.0])) == 0.02


@pytest.mark.parametrize(("step", "soft_depth"), [(0.0, True), (0.03, False)])
def test_torso_knees_and_shanks_meet_blocks_with_edges_as_rigid_ground(
    core: ct.CDLL, step: float, soft_depth: bool
) -> None:
    """An upturned robot falls on sand: on level blocks it sinks 1.15 mm, beside a
    trench by 0.55 mm, as on rigid ground.
    """
    heights = np.zeros((40, 40))
    heights[:, 19:21] = -step  # the torso's corners are over the blocks beside them
    surface = Surface(kind="blocks", height=heights, x0=-2.0, y0=-2.0, cell=0.1)
    whole = changed(load_robot("athena"), body={"contact": "on"})
    robot = on(surface, soft(whole, "dry_sand", 0.0))
    ground = Ground(core, grid_bytes(surface))
    plant = Plant(core, changed(robot, terrain={"kind": "flat"}))
    folded: Array = np.tile([0.0, -0.3, 0.2], (6, 1))
    start: dict[str, Any] = {"quaternion": (0.0, 1.0, 0.0, 0.0), "angle": folded}
    start_on_grid(plant, ground, position=(0.0, 0.0, 0.042), **start)
    for k in range(60):
        plant.step(0.005 * (k + 1), Command(angle_ref=folded))
    out = plant.output(Command(angle_ref=folded))
    assert out.torso.contact_force[2] > 10.0
    assert (0.04 - out.torso.position[2] > 8e-4) == soft_depth
    assert abs(out.energy.residual) < 1e-2 * out.energy.dissipated
