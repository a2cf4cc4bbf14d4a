"""A foot that is dragged in its print through blocks of other heights meets no face at a depth: it
changes to a level block beside its own alone, where the faces around both agree, and keeps its own
until it is out of the others.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace

import numpy as np
import pytest
from states import changed
from test_soil_on_blocks import ATHENA, on, pushed, put, soft
from test_twin_motion import FEET, Pair, stood

from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.ground.patches import material_row
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.kinematics import foot_centres
from hexapod_cosim.models.records import Array, Terrain

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
