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
from hexapod_cosim.models.ground.catalogue import make_surface
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.patches import with_soil
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.kinematics import foot_centres
from hexapod_cosim.models.records import Array, Terrain
from hexapod_cosim.models.soil.presets import soil_preset
from hexapod_cosim.models.validation.robot import check_settings

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


def test_a_march_on_patches_of_soil_with_edges_closes_its_books(core: ct.CDLL) -> None:
    """The soil is that of the grid's table, on rigid ground."""
    rough = make_surface("rubble", {**TERRAINS["rubble"], "seed": 3})
    robot = on(with_soil(rough, "dry_sand"), changed(ATHENA, foot={"pad_radius": 0.025}))
    plant, _ground = put(core, robot)
    march(plant, 2.0)
    out = plant.output()
    assert out.foot.sinkage.max() > 1e-3
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
def test_a_foot_above_the_bottom_of_its_print_passes_the_nose_without_a_force(
    core: ct.CDLL, pad: float
) -> None:
    """The robot sinks, is raised by less than it has sunk, and is carried over the nose: a foot
    that met the wall of its own block from inside would be pressed by up to its radius.
    """
    bare = soft(ATHENA, "dry_sand", pad)
    robot = on(nose(bare, 0.004), bare)
    plant, _ground = put(core, robot)
    for k in range(60):
        plant.step(0.01 * (k + 1), pushed(robot, 0.0, 0.0, -1.0 if 20 < k < 40 else 0.0))
    sunk = plant.output().foot.sinkage[0]
    x = np.array(plant.coordinates)
    x[2] += 0.4 * sunk
    left = []
    for way in np.arange(0.0, 0.02, 5e-4):
        x[0] += 5e-4 if way > 0.0 else 0.0
        plant.coordinates = x
        plant.core.hx_plant_update_contacts(plant.handle)
        left.append(float(np.linalg.norm(plant.output().foot.force[0])))
    assert plant.output().foot.position[0, 0] > robot_nose(robot)
    assert max(left) == 0.0
    assert sunk > 0.002


def robot_nose(robot: Robot) -> float:
    surface = robot.terrain.surface
    assert surface is not None
    return surface.x0 + 20 * surface.cell


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


def test_a_foot_that_rolls_from_a_rigid_nose_onto_a_soft_top_stays_on_rigid_ground(
    core: ct.CDLL,
) -> None:
    """Its contact is the same before and behind the border, so its force has no jump."""
    bare = soft(ATHENA, "dry_sand", 0.0)
    edge = float(foot_centres(bare, stood(bare))[0, 0]) + 1e-4
    heights = np.zeros((40, 40))
    heights[:, :20] = -0.05  # the front feet begin over the lower blocks, at the edge
    surface = Surface(kind="blocks", height=heights, x0=edge - 2.0, y0=-1.97, cell=0.1)
    robot = on(surface, bare)
    plant, _ground = put(core, robot, height=0.0)
    force, over = [], []
    for k in range(60):
        plant.step(2e-4 * (k + 1), pushed(robot, 1.5, 0.0, 0.6))
        out = plant.output()
        force.append(float(out.foot.normal_force[0]))
        over.append(float(foot_centres(robot, plant.bodies)[0, 0]) > edge)
    first = over.index(True)
    assert 0 < first < 50
    assert force[first] > 0.5
    assert force[first] == pytest.approx(force[first - 1], rel=0.2)
    assert out.foot.sinkage[0] == 0.0


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


@pytest.mark.parametrize("name", ["stairs", "rubble"])
def test_two_instances_and_a_restored_one_move_by_the_same_bits(core: ct.CDLL, name: str) -> None:
    robot = on(make_surface(name, TERRAINS[name]), soft(ATHENA, "dry_sand", 0.025))
    made = [put(core, robot) for _ in range(3)]
    one, two, third = (plant for plant, _ in made)
    for plant in (one, two):
        march(plant, 0.7)
    saved = one.save()
    march(one, 1.1)
    march(two, 1.1)
    third.restore(saved)
    march(third, 1.1)
    assert one.save() == two.save() == third.save()
