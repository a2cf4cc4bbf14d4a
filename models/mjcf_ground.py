"""Writes a surface into a MuJoCo model: a height field, or boxes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.xml_elements import add, joined

BELOW = 0.1  # m    thickness below the lowest height
MOST_HEIGHTS = 1_000_000  # in a text file
APPROXIMATION = {
    "smooth": "Ground: triangles between the nodes replace the bicubic surface; it ends at the "
    "map's edges; materials of patches are omitted.",
    "blocks": "Ground: one box for each rectangle of blocks of equal height; it ends at the map's "
    "edges; materials of patches are omitted.",
}

Rectangle = tuple[int, int, int, int]  # first row, rows, first column, columns


def add_surface(
    root: ET.Element, world: ET.Element, surface: Surface, height: float, contact: Mapping[str, str]
) -> None:
    """Adds the surface, with 0 at `height` [m], to a model's assets and its world.

    contact: attributes of the geoms. Raises RobotError for a map too large for a text file.
    """
    if surface.height.size > MOST_HEIGHTS:
        what = "a map too large for an MJCF file"
        got = f"{surface.height.size} heights"
        expected = f"at most {MOST_HEIGHTS}"
        fix = "reduce its resolution"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=surface.name)
    common = {"material": "ground", **contact}
    if surface.kind == "smooth":
        _add_field(root, world, surface, height, common)
    else:
        _add_boxes(world, surface, height, common)


def _add_field(
    root: ET.Element, world: ET.Element, surface: Surface, height: float, common: Mapping[str, str]
) -> None:
    """Adds a height field, whose data are heights from 0 to 1 over its range."""
    left, right, low, high = surface.extent
    lowest, highest = float(surface.height.min()), float(surface.height.max())
    span = max(highest - lowest, 1e-6)
    asset = root.find("asset")
    assert asset is not None
    field = add(asset, "hfield", name="ground", nrow=str(surface.rows))
    field.set("ncol", str(surface.columns))
    field.set("size", joined((0.5 * (right - left), 0.5 * (high - low), span, BELOW)))
    # the first row of the attribute is the one at the largest y
    shares = (surface.height[::-1] - lowest) / span
    field.set("elevation", " ".join(f"{share:.9g}" for share in shares.ravel()))
    place = (0.5 * (left + right), 0.5 * (low + high), height + lowest)
    add(world, "geom", dict(common), name="ground", type="hfield", hfield="ground", pos=place)


def _add_boxes(
    world: ET.Element, surface: Surface, height: float, common: Mapping[str, str]
) -> None:
    """Adds a box for each rectangle of blocks of equal height."""
    bottom = float(surface.height.min()) - BELOW
    for number, (row, rows, column, columns) in enumerate(rectangles(surface.height)):
        top = float(surface.height[row, column])
        half = (0.5 * columns * surface.cell, 0.5 * rows * surface.cell, 0.5 * (top - bottom))
        place = (
            surface.x0 + surface.cell * column + half[0],
            surface.y0 + surface.cell * row + half[1],
            height + bottom + half[2],
        )
        add(world, "geom", dict(common), name=f"ground_{number}", type="box", size=half, pos=place)


def rectangles(height: Array) -> Iterator[Rectangle]:
    """Yields rectangles of equal height that cover a grid of blocks once.

    Each begins at the first block that is not covered, and extends along its row first.
    """
    covered = np.zeros(height.shape, dtype=np.bool_)
    for row, column in np.ndindex(*height.shape):
        if covered[row, column]:
            continue
        like = (height[row] == height[row, column]) & ~covered[row]
        columns = int(np.argmin(np.append(like[column:], False)))
        across = slice(column, column + columns)
        rows = 1
        while row + rows < len(height) and np.all(
            (height[row + rows, across] == height[row, column]) & ~covered[row + rows, across]
        ):
            rows += 1
        covered[row : row + rows, across] = True
        yield row, rows, column, columns
