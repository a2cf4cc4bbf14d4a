"""Makes a map of tiles for learning: rows of rising difficulty, a terrain in each column."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.ground.blocks import block_heights
from hexapod_cosim.models.ground.parameters import (
    HARD,
    RANDOM_TILE,
    SIZE,
    Entries,
    Entry,
    count,
    entry,
    length,
    text,
    with_defaults,
)
from hexapod_cosim.models.ground.rough import SMOOTH, rounded
from hexapod_cosim.models.ground.smooth import heights_at
from hexapod_cosim.models.ground.steps import BLOCKS
from hexapod_cosim.models.ground.surface import Surface

MOST_BLOCKS = 1 << 24
ROUGH_SCALE = 0.1  # m  least spacing of random heights of smooth tiles
EQUAL = "equal"  # proportions: columns have the terrains by turns


# names of legged_gym
TILE_ALIASES = {
    "smooth_slope": "pyramid_slope",
    "stairs_up": "inverted_pyramid_stairs",
    "stairs_down": "pyramid_stairs",
    "discrete": "discrete_obstacles",
}
CURRICULUM: Entries = {}  # the surface by its name
TILES: Entries = {name: one for name, one in {**BLOCKS, **SMOOTH}.items() if one.tile}
TILES |= {new: TILES[old] for new, old in TILE_ALIASES.items()}
FIRST = "pyramid_stairs inverted_pyramid_stairs discrete_obstacles stepping_stones"


@entry(
    CURRICULUM,
    "Tiles of rising difficulty along +x, terrains in columns",
    {
        **RANDOM_TILE,
        "size": replace(SIZE, about="edge of a tile"),
        "difficulty": replace(HARD, default=1.0, about="of the last row; the first has 0"),
        "num_rows": count(5, "tiles along x", most=1000),
        "num_cols": count(4, "tiles along y", most=1000),
        "border_width": length(1.0, "level ground around the tiles", zero=True),
        "terrains": text(FIRST, "names of the columns' terrains"),
        "terrain_proportions": text(EQUAL, "columns' shares, one for each of terrains"),
    },
)
def curriculum(values: SimpleNamespace) -> Surface:
    """Returns num_rows tiles along +x, from difficulty 0 to `difficulty`, and num_cols along y.

    Columns have the terrains of `column_names`. The robot starts in the middle of the first row, in
    the column num_cols // 2. The middle height of each tile's edge is that of the border, so that
    tiles fit together; random tiles have different seeds. The map is smooth if all its terrains
    are; else it is made of blocks, with the heights of smooth tiles at the blocks' middles.

    Raises RobotError.
    """
    names, cell = column_names(values), values.horizontal_scale
    half, border = round(0.5 * values.size / cell), round(values.border_width / cell)
    _check_room(values, half, border)
    smooth = all(TILES[name].make.__name__ in SMOOTH for name in names)
    extra = 1 if smooth else 0  # a map has a node more than cells along a line
    shape = tuple(
        2 * (half * count + border) + extra for count in (values.num_cols, values.num_rows)
    )
    height, start = np.zeros(shape), values.num_cols // 2
    places = cell * (np.arange(-half, half + extra) + (0.0 if smooth else 0.5))
    for row in range(values.num_rows):
        for column in range(values.num_cols):
            tile = _tile(values, TILES[names[column]], places, row, column)
            below, left = (border + 2 * half * place for place in (column, row))
            height[below : below + len(places), left : left + len(places)] = tile
    first = border + half, border + (2 * start + 1) * half  # blocks before the robot's start
    height -= height[first[1], first[0]]
    x0, y0 = (-cell * count for count in first)
    kind = "smooth" if smooth else "blocks"
    return Surface(kind=kind, height=height, x0=x0, y0=y0, cell=cell, name="curriculum")


def column_names(values: SimpleNamespace) -> list[str]:
    """Returns the terrain of each of num_cols columns, by `terrains` and `terrain_proportions`.

    Raises RobotError.
    """
    names, columns = tile_names(values.terrains), values.num_cols
    if values.terrain_proportions.strip() == EQUAL:
        return [names[column % len(names)] for column in range(columns)]
    shares = np.cumsum(_proportions(values.terrain_proportions, names))
    middles = (np.arange(columns) + 0.5) / columns * shares[-1]
    return [names[k] for k in np.searchsorted(shares, middles, side="right")]


def _proportions(text: str, names: list[str]) -> list[float]:
    """Returns the share of each terrain. Raises RobotError."""
    try:
        shares = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        shares = []
    proper = all(math.isfinite(share) and share >= 0.0 for share in shares)
    if len(shares) != len(names) or not proper or not sum(shares) > 0.0:
        what = "proportions that do not fit the terrains"
        expected = f"{len(names)} numbers >= 0, one for each of {', '.join(names)}, or {EQUAL}"
        fix = "change terrain.terrain_proportions or terrain.terrains"
        raise RobotError(what, got=text, expected=expected, fix=fix)
    return shares


def tile_names(text: str) -> list[str]:
    """Returns the names in a list separated by spaces or commas. Raises RobotError."""
    names = text.replace(",", " ").split()
    for name in names:
        if name not in TILES:
            raise unknown_name("terrain of tiles", name, TILES, error=RobotError)
    if not names:
        fix = "name the terrains of the columns in terrain.terrains"
        raise RobotError("no terrains", got=text, expected="some names", fix=fix)
    return names


def _tile(values: SimpleNamespace, maker: Entry, places: Array, row: int, column: int) -> Array:
    """Returns the heights of a tile above the border [m] at places along x and y [m]."""
    is_smooth = maker.make.__name__ in SMOOTH
    given = {
        "size": values.size,
        "horizontal_scale": values.horizontal_scale,
        "platform_size": values.platform_size,
        "difficulty": values.difficulty * row / max(values.num_rows - 1, 1),
    }
    if "seed" in maker.parameters:
        given |= {
            "seed": values.seed + row * values.num_cols + column,
            "vertical_scale": values.vertical_scale,
        }
        if is_smooth:
            given["horizontal_scale"] = max(values.horizontal_scale, ROUGH_SCALE)
    tile = maker.make(SimpleNamespace(**with_defaults(maker.parameters, given, "terrain")))
    heights = (
        rounded(heights_at(tile, places, places))  # sums differ between machines
        if is_smooth
        else block_heights(tile, places, places)
    )
    edges = np.concatenate([heights[0], heights[-1], heights[:, 0], heights[:, -1]])
    return np.asarray(heights - np.sort(edges)[len(edges) // 2])


def _check_room(values: SimpleNamespace, half: int, border: int) -> None:
    """Raises RobotError for platforms that cover their tiles, and for maps that are too large."""
    cell = values.horizontal_scale
    if half < 1 or values.platform_size > cell * (2 * half - 2):
        what = "the flat platforms cover their tiles"
        got = f"size {values.size:g} m, platform_size {values.platform_size:g} m"
        expected = f"a size of at least {values.platform_size + 2.0 * cell:.6g} m"
        fix = "enlarge terrain.size, or reduce terrain.platform_size"
        raise RobotError(what, got=got, expected=expected, fix=fix)
    count = 4 * (half * values.num_rows + border) * (half * values.num_cols + border)
    if count > MOST_BLOCKS:
        what = "the curriculum is too large"
        fix = "reduce terrain.num_rows, num_cols or border_width, or raise horizontal_scale"
        raise RobotError(what, got=f"{count} blocks", expected=f"at most {MOST_BLOCKS}", fix=fix)
