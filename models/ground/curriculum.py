"""Makes a map of tiles for learning: rows of rising difficulty, a terrain in each column."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import SimpleNamespace

import numpy as np

from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.ground.blocks import block_height
from hexapod_cosim.models.ground.parameters import Parameters, with_defaults
from hexapod_cosim.models.ground.surface import Array, Surface

MOST_BLOCKS = 1 << 24
Makers = Mapping[str, tuple[Callable[[SimpleNamespace], Surface], Parameters]]


def curriculum(values: SimpleNamespace, makers: Makers) -> Surface:
    """Returns num_rows tiles along +x, from difficulty 0 to `difficulty`, and num_cols along y.

    Column j has the terrain j of `terrains`, which is repeated. The robot starts in the middle of
    the first row, in the column num_cols // 2. The middle height of each tile's edge is that of
    the border, so that tiles fit together; random tiles have different seeds.

    Args:
        values: the parameters of the catalogue's surface.
        makers: function and parameters of the terrains that tiles may have.

    Raises RobotError.
    """
    names, cell = tile_names(values.terrains, makers), values.horizontal_scale
    half, border = round(0.5 * values.size / cell), round(values.border_width / cell)
    _check_room(values, half, border)
    shape = 2 * (half * values.num_cols + border), 2 * (half * values.num_rows + border)
    height, start = np.zeros(shape), values.num_cols // 2
    for row in range(values.num_rows):
        for column in range(values.num_cols):
            tile = _tile(values, makers, names[column % len(names)], row, column)
            below, left = (border + 2 * half * place for place in (column, row))
            height[below : below + 2 * half, left : left + 2 * half] = tile
    first = border + half, border + (2 * start + 1) * half  # blocks before the robot's start
    height -= height[first[1], first[0]]
    x0, y0 = (-cell * count for count in first)
    return Surface(kind="blocks", height=height, x0=x0, y0=y0, cell=cell, name="curriculum")


def tile_names(text: str, makers: Makers) -> list[str]:
    """Returns the names in a list separated by spaces or commas. Raises RobotError."""
    names = text.replace(",", " ").split()
    for name in names:
        if name not in makers:
            raise unknown_name("terrain of tiles", name, makers, error=RobotError)
    if not names:
        raise RobotError(
            "a curriculum without terrains",
            got=text,
            expected=f"some of {', '.join(makers)}",
            fix="name the terrains of the columns in terrain.terrains",
        )
    return names


def _tile(values: SimpleNamespace, makers: Makers, name: str, row: int, column: int) -> Array:
    """Returns the heights of a tile above the border [m]."""
    make, parameters = makers[name]
    given = {
        "size": values.size,
        "horizontal_scale": values.horizontal_scale,
        "platform_size": values.platform_size,
        "difficulty": values.difficulty * row / max(values.num_rows - 1, 1),
    }
    if "seed" in parameters:
        given |= {
            "seed": values.seed + row * values.num_cols + column,
            "vertical_scale": values.vertical_scale,
        }
    tile = make(SimpleNamespace(**with_defaults(parameters, given, "terrain")))
    half = round(0.5 * values.size / values.horizontal_scale)
    places = values.horizontal_scale * (np.arange(-half, half) + 0.5)
    heights = np.array([[block_height(tile, x, y) for x in places] for y in places])
    edges = np.concatenate([heights[0], heights[-1], heights[:, 0], heights[:, -1]])
    return np.asarray(heights - np.sort(edges)[len(edges) // 2])


def _check_room(values: SimpleNamespace, half: int, border: int) -> None:
    """Raises RobotError for platforms that cover their tiles, and for maps that are too large."""
    cell = values.horizontal_scale
    if half < 1 or values.platform_size > cell * (2 * half - 2):
        raise RobotError(
            "the flat platforms cover their tiles",
            got=f"size {values.size:g} m, platform_size {values.platform_size:g} m",
            expected=f"a size of at least {values.platform_size + 2.0 * cell:.6g} m",
            fix="enlarge terrain.size, or reduce terrain.platform_size",
        )
    count = 4 * (half * values.num_rows + border) * (half * values.num_cols + border)
    if count > MOST_BLOCKS:
        raise RobotError(
            "the curriculum is too large",
            got=f"{count} blocks",
            expected=f"at most {MOST_BLOCKS}",
            fix="reduce terrain.num_rows, num_cols or border_width, or raise horizontal_scale",
        )
