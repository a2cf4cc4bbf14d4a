"""Motion on grids: a plane as a slope, rebounds, forces over borders and noses, energy, bits,
and maps of several sizes.
"""

from __future__ import annotations

import ctypes as ct
import math

import numpy as np
import pytest
from grids import BLOCKS, Ground, grid_bytes, on_grid, sampled, start_on_grid
from mirror import BAD_STATE, HxInput, HxOutput
from plant import Plant, PlantError, flat
from states import changed

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.dynamics import Command

ATHENA = load_robot("athena")
HEIGHT = 0.2  # m, of the torso above the ground at the start


def marching(robot: Robot, t: float) -> Command:
    """Returns a command that swings the legs by turns: 1 s a cycle, two groups of three."""
    angle = np.array(robot.stance)
    for leg in range(6):
        phase = 2.0 * math.pi * (t + 0.5 * (leg % 2))
        lift = max(math.sin(phase), 0.0)
        angle[leg, 0] += 0.25 * math.cos(phase) * (1.0 if leg < 3 else -1.0)
        angle[leg, 1] -= 0.35 * lift
        angle[leg, 2] += 0.1 * lift
    return Command(angle_ref=angle)


def march(plant: Plant, until: float) -> Array:
    """Marches to a time [s] and returns the torso's path (n, 3), 50 times a second."""
    path = []
    for k in range(round(plant.time * 50), round(50 * until)):
        plant.step((k + 1) / 50, marching(plant.robot, k / 50))
        path.append(plant.output().torso.position)
    return np.array(path)


def rough(seed: int, *, size: float = 4.0, kind: int = 1) -> bytes:
    """Returns a rough ground: 50 mm cells, 10 mm high, blocks in levels of 5 mm."""
    rng, n = np.random.default_rng(seed), round(size / 0.05)
    height: Array = np.array(rng.uniform(0.0, 0.01, (n, n)))
    if kind == BLOCKS:
        height = 0.005 * rng.integers(0, 3, (n, n)).astype(float)
    return grid_bytes(height, cell=0.05, origin=(-size / 2, -size / 2), kind=kind)


def test_a_grid_that_is_a_plane_gives_the_path_of_the_slope(core: ct.CDLL) -> None:
    heading, incline = 0.5, 0.08
    robot = changed(
        ATHENA, terrain={"kind": "slope", "incline": incline, "heading": heading, "height": 0.0}
    )
    rise = math.tan(incline)
    ground = Ground(
        core,
        sampled(
            lambda x, y: rise * (math.cos(heading) * x + math.sin(heading) * y), size=6.0, cell=0.05
        ),
    )
    place = {"position": (0.0, 0.0, HEIGHT)}
    difference = march(Plant(core, robot, **place), 10.0) - march(
        on_grid(core, ATHENA, ground, **place), 10.0
    )
    assert np.abs(difference).max() < 1e-9


def forces(plant: Plant, x: float, z: float) -> Array:
    """Returns the force on each foot (6, 3) of the robot at rest with its torso at x, z."""
    body = plant.bodies
    body[:, 0] += x - body[0, 0]
    body[:, 2] += z - body[0, 2]
    plant.bodies = body
    return np.array(plant.output().foot.force)


def test_a_state_is_refused_over_another_ground(core: ct.CDLL) -> None:
    grounds = [Ground(core, rough(seed)) for seed in (4, 5)]
    assert grounds[0].checksum != grounds[1].checksum
    place = {"position": (0.0, 0.0, HEIGHT)}
    one, other = (on_grid(core, ATHENA, ground, **place) for ground in grounds)
    before = other.save()
    with pytest.raises(PlantError, match="its ground is a grid that this plant does not have") as e:
        other.restore(one.save())
    assert e.value.status == BAD_STATE
    assert other.save() == before


@pytest.mark.parametrize("kind", [1, BLOCKS])
def test_a_foot_deeper_than_its_radius_at_the_start_is_refused_with_its_depth(
    core: ct.CDLL, kind: int
) -> None:
    ground = Ground(core, grid_bytes(np.zeros((81, 81)), cell=0.05, origin=(-2, -2), kind=kind))
    plant = on_grid(core, ATHENA, ground, position=(0.0, 0.0, 1.0))
    above = float(np.min(np.array(plant.output().foot.position)[:, 2]))  # lowest points
    before = plant.save()
    refused = r"got foot .. 0\.02 m deep .* at most 0\.015 m; raise .* by 0\.005 m"
    with pytest.raises(PlantError, match=refused):
        start_on_grid(plant, ground, position=(0.0, 0.0, 1.0 - above - 0.02))
    assert plant.save() == before
    start_on_grid(plant, ground, position=(0.0, 0.0, 1.0 - above + 1e-6))


def test_derivatives_on_a_smooth_grid_are_those_of_differences(core: ct.CDLL) -> None:
    ground = Ground(core, rough(6))
    robot = changed(ATHENA, solver={"tolerance": 1e-8})
    plant = on_grid(core, robot, ground, position=(0.0, 0.0, HEIGHT))
    march(plant, 0.3)
    command, x = marching(robot, 0.3), plant.coordinates
    rng = np.random.default_rng(7)
    dx = rng.normal(size=x.size)
    dx[3:7] -= (dx[3:7] @ x[3:7]) * x[3:7]
    no_input = np.zeros(ct.sizeof(HxInput) // 8)
    exact, d_output = plant.tangent(command, no_input, dx)
    assert isinstance(d_output, HxOutput)
    difference = plant.rates_between(command, dx, 1e-7)
    assert np.abs(exact - difference).max() < 1e-4 * np.abs(difference).max()
    assert flat(d_output.foot.force).any()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_force_on_a_smooth_grid_turns_with_the_normal(core: ct.CDLL, axis: int) -> None:
    """The robot is moved along the ground under one foot, whose depth does not change then."""
    ground = Ground(core, rough(6))
    plant = on_grid(core, ATHENA, ground, position=(0.0, 0.0, HEIGHT))
    march(plant, 0.3)
    command, x, h = marching(ATHENA, 0.3), plant.coordinates, 1e-7
    leg = int(np.argmax(plant.output(command).foot.normal_force))
    no_input, way, up = np.zeros(ct.sizeof(HxInput) // 8), np.zeros(x.size), np.zeros(x.size)
    way[axis], up[2] = 1.0, 1.0
    along, above = (plant.tangent(command, no_input, dx)[1].foot for dx in (way, up))
    share = along.penetration[leg] / above.penetration[leg]
    exact = np.array(along.force[leg]) - share * np.array(above.force[leg])
    sides = []
    for sign in (1.0, -1.0):
        plant.coordinates = x + sign * h * (way - share * up)
        sides.append(np.array(plant.output(command).foot.force[leg]))
    difference = (sides[0] - sides[1]) / (2.0 * h)
    assert np.abs(difference).max() > 1.0  # N/m
    # of forces of 1e5 N/m the differences have eight digits
    assert exact == pytest.approx(difference, abs=1e-6 * np.abs(difference).max())


def test_a_material_s_friction_and_stiffness_are_those_of_the_touch_down(core: ct.CDLL) -> None:
    table = np.full((1, 16), np.nan)
    table[0, 0], table[0, 2], table[0, 3:] = 0.0, 2e5, 0.0
    ice = grid_bytes(
        np.zeros((41, 41)), cell=0.05, origin=(-1, -1), material=np.ones((41, 41)), table=table
    )
    robot = changed(ATHENA, friction={"law": "tanh"})
    place = {"position": (0.0, 0.0, HEIGHT)}
    plain = grid_bytes(np.zeros((41, 41)), cell=0.05, origin=(-1, -1))
    feet = []
    for file in (plain, ice):
        ground = Ground(core, file)
        plant = on_grid(core, robot, ground, **place)
        march(plant, 1.3)
        feet.append(plant.output(marching(robot, 1.3)).foot)
    assert np.max(feet[0].tangential_force) > 1.0
    assert np.all(feet[1].tangential_force == 0.0)
    depth = [foot.penetration[foot.contact != 0].mean() for foot in feet]
    load = [foot.normal_force[foot.contact != 0].mean() for foot in feet]
    stiffness = [f / d**1.5 for f, d in zip(load, depth, strict=True)]
    assert stiffness[1] < 0.5 * stiffness[0]


SMALL, LARGE = 64, 4096  # nodes along an edge
CELL = 0.0625  # m, a power of 2: the places of nodes are exact
TILE = SMALL * CELL
# m  a coordinate on the large map has an ulp 64 times as large: 1.4e-14 m, in a motion of 0.6 s
SAME = 1e-11


def periodic_map(nodes: int) -> bytes:
    """Returns a rough map whose heights around the origin do not depend on its size."""
    tile = np.random.default_rng(17).uniform(0.0, 0.01, (SMALL, SMALL))
    copies = nodes // SMALL
    origin = -TILE * (0.5 + (copies - 1) // 2)
    return grid_bytes(np.tile(tile, (copies, copies)), cell=CELL, origin=(origin, origin))


def landed(core: ct.CDLL, nodes: int) -> tuple[float, Array]:
    """Lets the robot land on a map and swing its legs; returns evaluations and bodies (19, 13)."""
    robot = load_robot("athena")
    ground = Ground(core, periodic_map(nodes))
    plant = on_grid(core, robot, ground, position=(0.0, 0.0, 0.15))
    for k in range(30):
        swing = 0.2 * np.sin(0.4 * k) * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
        angle = robot.stance + swing[:, None] * np.array([1.0, 0.3, 0.0])
        plant.step(0.02 * (k + 1), Command(angle_ref=angle))
    assert np.count_nonzero(plant.output().foot.landings) >= 3
    return float(plant.output().solver.evaluations), plant.bodies


def test_evaluations_and_motion_do_not_depend_on_the_size_of_the_map(core: ct.CDLL) -> None:
    (few, small), (many, large) = landed(core, SMALL), landed(core, LARGE)
    assert few == many
    assert np.abs(large - small).max() < SAME
