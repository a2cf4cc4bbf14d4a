"""A large height map costs no more evaluations than a small one and gives the same motion."""

from __future__ import annotations

import ctypes as ct

import numpy as np
from grids import Ground, grid_bytes, on_grid

from hexapod_cosim.models import load_robot
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.records import Array

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
