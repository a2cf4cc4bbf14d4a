"""Computes the faces of a surface of blocks that a sphere may touch.

The surface is the union of columns with flat tops. A sphere whose centre lies in a cell may touch
two faces at once: the top of that cell, and the nearest of the higher columns beside the cell. The
latter is touched at its wall while the centre is lower than its top, and at its edge or corner
above that. A neighbour that is not higher is hidden, so that there are no edges inside a flat area.
A diagonal neighbour counts only where its nearest point is above both columns beside it; else one
of them hides it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from hexapod_cosim.models.ground.surface import Array, Surface

UP = (0.0, 0.0, 1.0)


def _cell(coordinate: float, count: int) -> int:
    """Returns the cell of a grid coordinate; border cells go on beyond the map."""
    return min(max(math.floor(coordinate), 0), count - 1)


def _nearest(coordinate: float, cell: int, origin: float, size: float, count: int) -> float:
    """Returns the coordinate of a cell's range that is nearest; border cells have no outer end."""
    low = -math.inf if cell == 0 else origin + size * cell
    high = math.inf if cell == count - 1 else origin + size * (cell + 1)
    return min(max(coordinate, low), high)


def block_height(surface: Surface, x: float, y: float) -> float:
    """Returns the height [m] of the block at (x, y)."""
    row = _cell((y - surface.y0) / surface.cell, surface.rows)
    return float(surface.height[row, _cell((x - surface.x0) / surface.cell, surface.columns)])


def block_faces(surface: Surface, point: Array) -> list[tuple[float, Array]]:
    """Returns one or two faces near a point (3,): its distance [m] and the unit normal (3,).

    The first is the top of the point's own cell; its distance is negative below the top. The second
    is the nearest face, edge or corner of a higher neighbour, if there is one.
    """
    row = _cell((point[1] - surface.y0) / surface.cell, surface.rows)
    column = _cell((point[0] - surface.x0) / surface.cell, surface.columns)
    top = float(surface.height[row, column])
    faces = [(float(point[2]) - top, np.array(UP))]
    walls = list(_walls(surface, point, row, column))
    return [*faces, min(walls, key=lambda wall: wall[0])] if walls else faces


def _walls(surface: Surface, point: Array, row: int, column: int) -> Iterator[tuple[float, Array]]:
    """Yields distance and normal of the neighbours that are higher than the own cell."""
    own = float(surface.height[row, column])
    for dr, dc in ((0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)):
        r, c = row + dr, column + dc
        if not (0 <= r < surface.rows and 0 <= c < surface.columns):
            continue
        top = float(surface.height[r, c])
        near = np.array([
            _nearest(point[0], c, surface.x0, surface.cell, surface.columns),
            _nearest(point[1], r, surface.y0, surface.cell, surface.rows),
            min(float(point[2]), top),
        ])  # fmt: skip
        beside = max(float(surface.height[r, column]), float(surface.height[row, c]))
        if top <= own or (dr and dc and near[2] <= beside):
            continue
        way = point - near
        distance = float(np.linalg.norm(way))
        # a point on the wall itself: the wall's normal points back into the own cell
        back = np.array([-float(dc), -float(dr), 0.0])
        yield distance, way / distance if distance > 0.0 else back / np.linalg.norm(back)
