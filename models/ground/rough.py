"""Makes the smooth surfaces of the catalogue: slopes, waves, dunes and roughness.

Each function gets the checked parameters of its surface and returns a `Surface` with height 0 at
the world's origin, where the robot starts. Heights are rounded to a multiple of 2^-24 m, so that
the last digits of a machine's sine do not appear in them; sums of products are not rounded.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.parameters import (
    HORIZONTAL,
    RANDOM_TILE,
    SIZE,
    TILE,
    Entries,
    Parameters,
    entry,
    length,
    ratio,
    text,
)
from hexapod_cosim.models.ground.surface import Surface

SMOOTH: Entries = {}  # the surfaces by name
PLANE: Parameters = {"size": SIZE, "horizontal_scale": HORIZONTAL}
SLOPE = ratio((0.0, 0.4), "rise over run", least=-2.0, most=2.0)
SOIL = text("dry_sand", "name of the soil everywhere")
ROUGHNESS: Parameters = {
    **RANDOM_TILE,
    "horizontal_scale": replace(HORIZONTAL, default=0.1),
    "max_height": length((0.01, 0.05), "largest height above and below 0"),
}
QUANTUM = 2.0**24  # 1/m    60 nm
FLAT_CELLS = 2  # cells beyond the platform that its bicubic patches reach
BLEND = 0.25  # 1    width of the transition over the platform's size
WINDWARD = 0.7  # 1    share of a dune's length that rises


def _nodes(size_x: float, size_y: float, cell: float) -> tuple[Array, Array, float]:
    """Returns x and y (rows, columns) [m] of nodes around the origin, and their spacing."""
    columns, rows = (max(round(0.5 * size / cell), 1) for size in (size_x, size_y))
    x, y = (cell * np.arange(-count, count + 1) for count in (columns, rows))
    grid = np.meshgrid(x, y)
    return grid[0], grid[1], cell


def _surface(name: str, x: Array, y: Array, cell: float, height: Array) -> Surface:
    """Returns the surface of heights at nodes."""
    return Surface(
        kind="smooth", height=height, x0=float(x[0, 0]), y0=float(y[0, 0]), cell=cell, name=name
    )


def rounded(height: Array) -> Array:
    """Returns heights as multiples of 1/QUANTUM [m]."""
    return np.asarray(np.round(height * QUANTUM) / QUANTUM)


def off_platform(x: Array, y: Array, cell: float, platform: float) -> Array:
    """Returns 0 on the platform and 1 away from it, with a transition that is C1.

    The transition begins where no patch of the platform depends on the nodes any more.
    """
    if platform <= 0.0:
        return np.ones_like(x)
    outside = np.maximum(np.abs(x), np.abs(y)) - 0.5 * platform - FLAT_CELLS * cell
    share = np.clip(outside / max(BLEND * platform, cell), 0.0, 1.0)
    return np.asarray(share * share * (3.0 - 2.0 * share))


@entry(
    SMOOTH,
    "Inclined plane as a grid",
    {
        **PLANE,
        "slope_x": ratio(0.0, "rise along +x over run", least=-2.0, most=2.0),
        "slope_y": ratio(0.0, "rise along +y over run", least=-2.0, most=2.0),
    },
)
def plane(values: SimpleNamespace) -> Surface:
    """Returns the plane z = slope_x x + slope_y y, exact to rounding."""
    x, y, cell = _nodes(values.size, values.size, values.horizontal_scale)
    return _surface("plane", x, y, cell, values.slope_x * x + values.slope_y * y)


@entry(SMOOTH, "Level soil", {**PLANE, "soil": SOIL})
def sand(values: SimpleNamespace) -> Surface:
    """Returns a plane whose material is given by the parameter `soil` (table.py)."""
    x, y, cell = _nodes(values.size, values.size, values.horizontal_scale)
    return _surface("sand", x, y, cell, np.zeros_like(x))


@entry(
    SMOOTH,
    "Ramp up and down along +x",
    {**TILE, "slope": SLOPE, "ramp_length": length(0.5, "run of the ramp")},
)
def ramp(values: SimpleNamespace) -> Surface:
    """Returns a ramp along +x: level, up, level for half its length, and down again."""
    x, y, cell = _nodes(values.size, values.size, values.horizontal_scale)
    begin = 0.5 * values.platform_size + FLAT_CELLS * cell
    up = np.clip(x - begin, 0.0, values.ramp_length)
    down = np.clip(x - begin - 1.5 * values.ramp_length, 0.0, values.ramp_length)
    return _surface("ramp", x, y, cell, values.slope * (up - down))


@entry(
    SMOOTH,
    "Sine waves along x and y",
    {
        **TILE,
        "amplitude": length((0.02, 0.15), "largest height"),
        "num_waves": ratio(4.0, "waves along an edge of the map", least=0.1, most=1000.0),
    },
)
def wave(values: SimpleNamespace) -> Surface:
    """Returns waves along x and y: amplitude (sin(k x) + sin(k y))/2, k = 2 pi num_waves/size."""
    x, y, cell = _nodes(values.size, values.size, values.horizontal_scale)
    k = 2.0 * np.pi * values.num_waves / values.size
    height = 0.5 * values.amplitude * (np.sin(k * x) + np.sin(k * y))
    return _surface(
        "wave", x, y, cell, rounded(height * off_platform(x, y, cell, values.platform_size))
    )


@entry(
    SMOOTH,
    "Dunes across x, steep on their far side",
    {
        **TILE,
        "dune_height": length((0.03, 0.2), "height of a crest"),
        "dune_length": length(1.2, "from crest to crest", least=0.1, zero=True),
    },
)
def dune(values: SimpleNamespace) -> Surface:
    """Returns dunes across x: WINDWARD of a length rises gently, the rest falls.

    Their crests meander along y by a tenth of the length.
    """
    x, y, cell = _nodes(values.size, values.size, values.horizontal_scale)
    shift = 0.1 * np.sin(2.0 * np.pi * y / (2.0 * values.dune_length))
    phase = np.mod(x / values.dune_length + shift, 1.0)
    rise = 0.5 - 0.5 * np.cos(np.pi * phase / WINDWARD)
    fall = 0.5 + 0.5 * np.cos(np.pi * (phase - WINDWARD) / (1.0 - WINDWARD))
    height = values.dune_height * np.where(phase < WINDWARD, rise, fall)
    height = rounded(height * off_platform(x, y, cell, values.platform_size))
    return _surface("dune", x, y, cell, height)


@entry(SMOOTH, "Smooth roughness from random heights", ROUGHNESS)
def random_uniform(values: SimpleNamespace) -> Surface:
    """Returns random heights between -max_height and max_height, in steps of vertical_scale."""
    x, y, cell = _nodes(values.size, values.size, values.horizontal_scale)
    most = round(values.max_height / values.vertical_scale)
    draws = np.random.default_rng(values.seed).integers(-most, most, size=x.shape, endpoint=True)
    height = values.vertical_scale * draws.astype(np.float64)
    height = rounded(height * off_platform(x, y, cell, values.platform_size))
    return _surface("random_uniform", x, y, cell, height)
