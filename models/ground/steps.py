"""Makes the surfaces of blocks in the catalogue: stairs, steps, stones, gaps, rubble.

Each function gets the checked parameters of its surface and returns a `Surface` with height 0 at
the world's origin, where the robot starts. Widths are rounded to whole blocks; where a surface has
one width that repeats, the blocks are chosen so that the width is exact.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.parameters import (
    DEPTH,
    HARD,
    HORIZONTAL,
    ONE_STEP,
    PLATFORM,
    RANDOM_TILE,
    SEED,
    SIZE,
    STEPS,
    TILE,
    VERTICAL,
    Entries,
    count,
    entry,
    length,
)
from hexapod_cosim.models.ground.surface import Surface

BLOCKS: Entries = {}  # the surfaces by name
Mask = NDArray[np.bool_]


def _cells(size_x: float, size_y: float, cell: float) -> tuple[Array, Array]:
    """Returns x and y (rows, columns) [m] of the middles of blocks around the origin."""
    columns, rows = (max(round(0.5 * size / cell), 1) for size in (size_x, size_y))
    x, y = (cell * (np.arange(-count, count) + 0.5) for count in (columns, rows))
    grid = np.meshgrid(x, y)
    return grid[0], grid[1]


def _surface(name: str, x: Array, y: Array, cell: float, height: Array) -> Surface:
    """Returns the surface of blocks with these middles."""
    return Surface(
        kind="blocks",
        height=height,
        x0=float(x[0, 0]) - 0.5 * cell,
        y0=float(y[0, 0]) - 0.5 * cell,
        cell=cell,
        name=name,
    )


def _fitting(width: float, cell: float) -> float:
    """Returns the block edge near `cell` of which `width` is a whole multiple [m]."""
    return width / max(round(width / cell), 1)


def _platform(x: Array, y: Array, size: float) -> Mask:
    """Selects the blocks in the flat square around the start."""
    return np.maximum(np.abs(x), np.abs(y)) <= 0.5 * size


def _edge(platform: float, cell: float) -> float:
    """Returns half the platform's edge [m], rounded up to whole blocks."""
    return cell * math.ceil(0.5 * platform / cell - 1e-9)


@entry(
    BLOCKS,
    "Stairs up along +x and a landing",
    {**STEPS, "num_steps": count(5, "number of steps", most=1000)},
)
def stairs(values: SimpleNamespace) -> Surface:
    """Returns num_steps steps up along +x, which begin at the platform's edge, and a landing."""
    cell = _fitting(values.step_width, values.horizontal_scale)
    x, y = _cells(values.size, values.size, cell)
    begin = _edge(values.platform_size, cell)
    # the number of steps passed, from their begin on
    passed = np.clip(np.floor((x - begin) / values.step_width + 1.0), 0.0, values.num_steps)
    return _surface("stairs", x, y, cell, values.step_height * passed)


def _one_step(values: SimpleNamespace, name: str, sign: float) -> Surface:
    cell = values.horizontal_scale
    x, y = _cells(values.size, values.size, cell)
    high = x > _edge(values.platform_size, cell)
    return _surface(name, x, y, cell, np.where(high, sign * values.step_height, 0.0))


@entry(BLOCKS, "One step up along +x", ONE_STEP)
def step_up(values: SimpleNamespace) -> Surface:
    """Returns one step up along +x, at the platform's edge."""
    return _one_step(values, "step_up", 1.0)


@entry(BLOCKS, "One step down along +x", ONE_STEP)
def step_down(values: SimpleNamespace) -> Surface:
    """Returns one step down along +x, at the platform's edge."""
    return _one_step(values, "step_down", -1.0)


@entry(
    BLOCKS,
    "Square stones with gaps between them",
    {
        **RANDOM_TILE,
        "stone_size": length((0.5, 0.1), "edge of a stone", least=0.01, zero=True),
        "stone_distance": length(0.05, "width of the gaps"),
        "max_height": length(0.0, "largest deviation of the tops", zero=True),
        "depth": DEPTH,
    },
)
def stepping_stones(values: SimpleNamespace) -> Surface:
    """Returns square stones with gaps between them; each row of stones is shifted at random.

    The tops of stones vary by max_height in steps of vertical_scale.
    """
    cell = values.horizontal_scale
    x, y = _cells(values.size, values.size, cell)
    stone, gap = (
        max(round(width / cell), 1) for width in (values.stone_size, values.stone_distance)
    )
    generator, most = np.random.default_rng(values.seed), _levels(values)
    height = np.full(x.shape, -values.depth)
    for row in range(0, len(x), stone + gap):
        begin = -int(generator.integers(0, stone, endpoint=True))
        for column in range(begin, x.shape[1], stone + gap):
            top = int(generator.integers(-most, most, endpoint=True))
            across = slice(max(column, 0), max(column + stone, 0))
            height[row : row + stone, across] = values.vertical_scale * top
    height[_platform(x, y, values.platform_size)] = 0.0
    return _surface("stepping_stones", x, y, cell, height)


def _levels(values: SimpleNamespace) -> int:
    """Returns max_height in steps of vertical_scale."""
    return round(float(values.max_height) / float(values.vertical_scale))


@entry(
    BLOCKS,
    "Gaps across x",
    {
        **TILE,
        "gap_size": length((0.02, 0.2), "width of a gap", least=0.01, zero=True),
        "gap_distance": length(0.4, "ground between two gaps"),
        "depth": DEPTH,
    },
)
def gaps(values: SimpleNamespace) -> Surface:
    """Returns gaps across x, gap_size wide and gap_distance apart, from the platform's edge on."""
    cell = _fitting(values.gap_size, values.horizontal_scale)
    x, y = _cells(values.size, values.size, cell)
    width = round(values.gap_size / cell)
    period = width + max(round(values.gap_distance / cell), 1)
    begin = _edge(values.platform_size, cell)
    block = np.floor((np.abs(x) - begin) / cell)
    open_ = (block >= 0.0) & (np.mod(block, period) < width)
    return _surface("gaps", x, y, cell, np.where(open_, -values.depth, 0.0))


def random_tops(values: SimpleNamespace, x: Array, y: Array, cell: float) -> Array:
    """Returns heights of square stones from 0 to max_height, in steps of vertical_scale."""
    most, width = _levels(values), max(round(values.stone_size / cell), 1)
    rows, columns = (-(-count // width) for count in x.shape)
    draws = np.random.default_rng(values.seed).integers(0, most, (rows, columns), endpoint=True)
    tops = np.kron(draws, np.ones((width, width), dtype=np.int64))[: len(x), : x.shape[1]]
    return np.asarray(values.vertical_scale * tops.astype(np.float64))


@entry(
    BLOCKS,
    "Square stones of random height",
    {
        **RANDOM_TILE,
        "stone_size": length(0.2, "edge of a stone", least=0.01, zero=True),
        "max_height": length((0.02, 0.1), "largest height of a stone"),
    },
)
def rubble(values: SimpleNamespace) -> Surface:
    """Returns square stones of random heights from 0 to max_height, without gaps."""
    cell = _fitting(values.stone_size, values.horizontal_scale)
    x, y = _cells(values.size, values.size, cell)
    height = random_tops(values, x, y, cell)
    height[_platform(x, y, values.platform_size)] = 0.0
    return _surface("rubble", x, y, cell, height)


@entry(
    BLOCKS,
    "5 m of rubble, kerbs, stones with gaps, stairs, along +x",
    {
        "size": replace(SIZE, default=2.0, about="width of the course"),
        "horizontal_scale": HORIZONTAL,
        "platform_size": PLATFORM,
        "difficulty": HARD,
        "step_height": length((0.015, 0.1), "height of kerbs, stairs and rubble"),
        "depth": DEPTH,
        "vertical_scale": VERTICAL,
        "seed": SEED,
    },
)
def course(values: SimpleNamespace) -> Surface:
    """Returns a course of 5 m along +x: rubble, kerbs, stones with gaps, stairs up and down.

    Each of the five sections is 1 m long; the last one is level. All heights are of step_height.
    """
    cell = values.horizontal_scale
    x, y = _cells(2.0 * (5.0 + 0.5 * values.platform_size), values.size, cell)
    keep = x[0] > -0.5 * values.size
    x, y = x[:, keep], y[:, keep]
    along = x - _edge(values.platform_size, cell)
    section = np.floor(along)
    within = along - section
    stone = SimpleNamespace(
        max_height=values.step_height,
        vertical_scale=values.vertical_scale,
        stone_size=0.2,
        seed=values.seed,
    )
    kerb = np.where(np.mod(np.floor(within / 0.25), 2.0) == 1.0, values.step_height, 0.0)
    in_gap = (np.mod(within, 0.25) >= 0.2) | (np.mod(y + 100.0, 0.25) >= 0.2)
    stones = np.where(in_gap, -values.depth, 0.0)
    climb = np.floor(np.minimum(within, 1.0 - within) / 0.2 + 1e-9)
    sections = [random_tops(stone, x, y, cell), kerb, stones, values.step_height * climb]
    height = np.zeros_like(x)
    for number, part in enumerate(sections):
        height = np.where(section == number, part, height)
    return _surface("course", x, y, cell, height)
