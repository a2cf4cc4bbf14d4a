"""Measures what the size of a height map costs: time to load it, and time of an evaluation.

The maps have the same heights around the robot, so the walks are the same; the large one repeats
the small one's heights.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from statistics import median
from typing import Any

import numpy as np
from grids import Ground, on_grid
from numpy.typing import NDArray
from plant import Plant, bound, inputs

from benchmarks import BUILD
from benchmarks.ground.waves import OurEngine
from benchmarks.toolchain import Tools
from benchmarks.walks import STEP, commands, family
from hexapod_cosim.models.ground.grid_file import read_grid, write_grid
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.statics import settled

Array = NDArray[np.float64]

SMALL, LARGE = 64, 4096  # nodes along an edge
CELL, HIGHEST = 0.0625, 0.01  # m
SEED = 17
ROUNDS = 9  # maps alternate; the median counts


def map_of(nodes: int) -> Surface:
    """Returns a rough map around the origin, periodic over 64 nodes."""
    tile = np.random.default_rng(SEED).uniform(0.0, HIGHEST, (SMALL, SMALL))
    height = np.tile(tile, (nodes // SMALL, nodes // SMALL))
    tiles_before = (nodes // SMALL - 1) // 2  # of the one around the origin
    origin = -CELL * SMALL * (0.5 + tiles_before)
    return Surface(kind="smooth", height=height, x0=origin, y0=origin, cell=CELL, name="rough")


def map_costs(tools: Tools, *, quick: bool) -> list[dict[str, Any]]:
    """Returns a record for each size: time to load [s], evaluations, time of one [us]."""
    engine = OurEngine(tools)
    bound(engine.core)
    sizes = (SMALL, 1024) if quick else (SMALL, LARGE)
    found, grounds = [], []
    for nodes in sizes:
        seconds, ground = loaded(engine, nodes)
        grounds.append(ground)
        found.append({"nodes": nodes, "load": seconds})
    walks = [walked(engine, ground) for ground in grounds]
    rounds = [[next(walk) for walk in walks] for _ in range(ROUNDS)]
    for place, record in enumerate(found):
        evaluations = rounds[0][place][0]
        each = median(seconds for _, seconds in (row[place] for row in rounds)) / evaluations
        record |= {"evaluations": evaluations, "microseconds_per_evaluation": 1e6 * each}
    return found


def loaded(engine: OurEngine, nodes: int) -> tuple[float, Ground]:
    """Returns the least time of three to read a map's file and to load it [s], and the ground."""
    folder = BUILD / "ground"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{nodes}.terrain"
    if not path.exists() or read_grid(path) != map_of(nodes):
        write_grid(map_of(nodes), path)
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        ground = Ground(engine.core, path.read_bytes())
        times.append(time.perf_counter() - begin)
    return min(times), ground


def walked(engine: OurEngine, ground: Ground) -> Iterator[tuple[int, float]]:
    """Yields evaluations and loop's time [s] of one walk on a map after the other."""
    walk = family()[0]
    position, quaternion, angle = settled(walk.robot)
    records = [inputs(command) for command in commands(walk)]
    start = {"position": position + np.array([0.0, 0.0, HIGHEST]), "angle": angle}
    while True:
        plant = on_grid(engine.core, walk.robot, ground, quaternion=quaternion, **start)
        begin = time.perf_counter()
        for k, record in enumerate(records):
            engine.core.hx_plant_step(plant.handle, record, (k + 1) * STEP)
        seconds = time.perf_counter() - begin
        yield evaluations_of(plant), seconds


def evaluations_of(plant: Plant) -> int:
    """Returns the count of evaluations since the start."""
    return int(plant.output().solver.evaluations)
