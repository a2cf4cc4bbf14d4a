"""Tests soil on blocks with edges, and a foot that is dragged in its footprint
through blocks of other heights.
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
from test_twin_motion import FEET, Pair, stood

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.contact.footprints import footprint_depth
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.ground.grid_file import grid_bytes
from hexapod_cosim.models.ground.patches import material_row
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


# A foot that is dragged in its print through blocks of other heights meets no face at a depth: it
# changes to a level block beside its own alone, where the faces around both agree, and keeps its
# own until it is out of the others.

CELL = 0.031  # m
SLIPPERY = changed(FEET, foot={"pad_radius": 0.025}, friction={"mu": 0.05})


def dragged(
    core: ct.CDLL, height: Array, velocity: tuple[float, float], before: tuple[float, float]
) -> Pair:
    """Returns plant and twin, whose first foot is in sand on block (20, 20).

    height: (40, 40) m, of the blocks. velocity: of the robot along x and y [m/s]. before: the ways
    of the foot to the upper ends of its block along x and y [m].

    It sinks at first: whether soil yields at a foot that moves level depends on the last bits.
    """
    body = stood(SLIPPERY, height=-1e-3, velocity=(*velocity, -0.02))
    foot = foot_centres(SLIPPERY, body)[0]
    material = np.zeros((40, 40), dtype=np.uint8)
    material[18:23, :21] = 1
    surface = Surface(
        kind="blocks",
        height=height,
        x0=float(foot[0]) + before[0] - CELL * 21,
        y0=float(foot[1]) + before[1] - CELL * 21,
        cell=CELL,
        material=material,
        materials=material_row({"soil": "dry_sand"})[None],
    )
    return Pair(core, replace(SLIPPERY, terrain=Terrain(kind="grid", surface=surface)), body)


def still(_: float) -> Command:
    return Command(angle_ref=SLIPPERY.stance)


def block_below(pair: Pair) -> tuple[int, int]:
    """Returns row and column of the block below the first foot."""
    surface = pair.robot.terrain.surface
    assert surface is not None
    x, y, _ = foot_centres(pair.robot, pair.state.body)[0].tolist()
    return int((y - surface.y0) // CELL), int((x - surface.x0) // CELL)


def assert_closed(pair: Pair) -> None:
    """Asserts that the books close: a wall at the depth of a radius would give 12 J."""
    energy = pair.plant.output().energy
    assert abs(energy.residual) < 1e-3 * energy.dissipated


def test_a_foot_that_was_dragged_through_a_higher_block_meets_no_wall_behind_it(
    core: ct.CDLL,
) -> None:
    """Along x: its own block, a trench, a block that is 10 mm higher, level ones."""
    height = np.zeros((40, 40))
    height[17:24, 21], height[17:24, 22] = -0.03, 0.01
    pair = dragged(core, height, (1.6, 0.0), (1e-3, 0.5 * CELL))
    state = pair.move(0.06, still)
    assert_closed(pair)
    pair.assert_same()
    assert block_below(pair) == (20, 23)
    assert state.contacts.cell[0] == (20, 20)
    assert state.contacts.states[0].is_soft


@pytest.mark.parametrize("seed", [1042, 1151])
def test_feet_that_are_dragged_over_random_blocks_get_no_energy(core: ct.CDLL, seed: int) -> None:
    """A push drags the robot by 0.2 to 0.5 m: feet leave their prints in higher blocks, or there
    touch the walls beside their own.
    """
    rng = np.random.default_rng(seed)
    step, push, pad = rng.choice([0.01, 0.02]), rng.choice([0.7, 1.3]), rng.choice([0.0, 0.025])
    mu, down = rng.choice([0.05, 0.1, 0.5]), rng.choice([0.0, 0.3, 0.7, 1.3])
    heading, levels, end = rng.uniform(0.0, 6.28), int(rng.integers(2, 4)), rng.choice([30, 60, 90])
    height = step * rng.integers(0, levels, (40, 40)).astype(float)
    x0, y0 = -2.0 - rng.uniform(0.0, 0.1), -1.97 - rng.uniform(0.0, 0.1)
    surface = Surface(kind="blocks", height=height, x0=x0, y0=y0, cell=0.1)
    soil = str(rng.choice(["clay", "dry_sand", "mud"]))
    robot = on(surface, soft(changed(ATHENA, friction={"mu": float(mu)}), soil, float(pad)))
    plant, _ground = put(core, robot, height=(levels - 1) * step + 0.002)
    shares = (push * np.cos(heading), push * np.sin(heading), -down)
    for k in range(60):
        plant.step(0.01 * (k + 1), pushed(robot, *(shares if 10 < k < end else (0.0, 0.0, 0.0))))
    energy = plant.output().energy
    assert energy.residual < 1e-3 * energy.dissipated
