"""Computes the faces of a surface of blocks that a sphere may touch.

The surface is the union of columns with flat tops. A sphere whose centre lies in a cell may touch
four faces at once: the top of that cell, and higher columns beside it along x, along y and across a
corner. These are touched at their walls while the centre is lower than their tops, and at an edge
or corner above that (eq. 34). A neighbour that is not higher is hidden, so that there are no edges
inside a flat area. A diagonal neighbour counts only where its nearest point is above both columns
beside it; else one of them hides it.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.surface import Surface

UP = (0.0, 0.0, 1.0)
TOP = "top"
FACES = (TOP, "wall", "side", "corner")  # that a sphere can touch at once
NEIGHBOURS = {  # rows and columns from the cell
    "wall": ((0, -1), (0, 1)),
    "side": ((-1, 0), (1, 0)),
    "corner": ((-1, -1), (-1, 1), (1, -1), (1, 1)),
}

Cell = tuple[int, int]  # row, column


def _cell(coordinate: float, count: int) -> int:
    """Returns the cell of a grid coordinate; border cells go on beyond the map."""
    return min(max(math.floor(coordinate), 0), count - 1)


def block_height(surface: Surface, x: float, y: float) -> float:
    """Returns the height [m] of the block at (x, y)."""
    return float(surface.height[cell_at(surface, x, y)])


def block_heights(surface: Surface, x: Array, y: Array) -> Array:
    """Returns the heights (y, x) [m] of the blocks at all pairs of x and y [m]."""
    row = np.floor((y - surface.y0) / surface.cell).clip(0, surface.rows - 1).astype(int)
    column = np.floor((x - surface.x0) / surface.cell).clip(0, surface.columns - 1).astype(int)
    heights: Array = surface.height[np.ix_(row, column)]
    return heights


def cell_at(surface: Surface, x: float, y: float) -> Cell:
    """Returns row and column of the cell at (x, y) [m]."""
    return (
        _cell((y - surface.y0) / surface.cell, surface.rows),
        _cell((x - surface.x0) / surface.cell, surface.columns),
    )


def outside(surface: Surface, x: float, y: float, cell: Cell) -> float:
    """Returns how far (x, y) is outside of a cell [m], negative inside; border cells have no outer
    end.
    """
    ways = []
    for place, origin, index, count in (
        (y, surface.y0, cell[0], surface.rows),
        (x, surface.x0, cell[1], surface.columns),
    ):
        low = origin + surface.cell * index
        ways.append(low - place if index > 0 else -math.inf)
        ways.append(place - low - surface.cell if index < count - 1 else -math.inf)
    return max(ways)


def block_faces(surface: Surface, point: Array) -> list[tuple[float, Array]]:
    """Returns one or two faces near a point (3,): its distance [m] and the unit normal (3,).

    The first is the top of the point's own cell; its distance is negative below the top. The second
    is the nearest face, edge or corner of a higher neighbour, if there is one.
    """
    cell = cell_at(surface, float(point[0]), float(point[1]))
    found = [block_face(surface, point, kind, cell) for kind in FACES]
    faces = [face for face in found if face is not None]
    return [faces[0], min(faces[1:], key=lambda face: face[0])] if len(faces) > 1 else faces


def block_face(surface: Surface, point: Array, kind: str, cell: Cell) -> tuple[float, Array] | None:
    """Returns distance [m] and normal (3,) of one of FACES around a cell, None if there is none.

    wall, side and corner are those of the higher columns beside the cell along x, along y and
    across its corners. The columns are those of this cell also for a point outside of it, so that
    distances change smoothly.
    """
    own = float(surface.height[cell])
    if kind == TOP:
        return float(point[2]) - own, np.array(UP)
    faces = [
        _neighbour(surface, point, cell, way)
        for way in NEIGHBOURS[kind]
        if _column(surface, cell[0] + way[0], cell[1] + way[1]) > own
    ]
    return min(faces, key=lambda face: face[0]) if faces else None


def _column(surface: Surface, row: int, column: int) -> float:
    """Returns the height [m] of a column, of the border's beyond the map."""
    r, c = min(max(row, 0), surface.rows - 1), min(max(column, 0), surface.columns - 1)
    return float(surface.height[r, c])


def _neighbour(surface: Surface, point: Array, cell: Cell, way: Cell) -> tuple[float, Array]:
    """Returns distance [m] and normal (3,) of the neighbouring column of a cell along `way`."""
    (row, column), (dr, dc) = cell, way
    top = _column(surface, row + dr, column + dc)
    gap_x = gap_to(float(point[0]), surface.x0 + surface.cell * column, surface.cell, dc)
    gap_y = gap_to(float(point[1]), surface.y0 + surface.cell * row, surface.cell, dr)
    above = float(point[2]) - top
    if dr and dc:
        away = np.array([-dc * max(gap_x, 0.0), -dr * max(gap_y, 0.0), max(above, 0.0)])
    elif above <= 0.0:  # beside the wall; behind it the distance is negative
        return gap_x + gap_y, np.array([-float(dc), -float(dr), 0.0])
    elif gap_x + gap_y <= 0.0:  # over the neighbour
        return above, np.array(UP)
    else:
        away = np.array([-dc * gap_x, -dr * gap_y, above])
    distance = float(np.linalg.norm(away))
    back = np.array([-float(dc), -float(dr), 0.0])
    return distance, away / distance if distance > 0.0 else back / np.linalg.norm(back)


def gap_to(coordinate: float, low: float, size: float, way: int) -> float:
    """Returns the gap (eq. 34) [m] to the neighbour on one side of a cell from `low` on."""
    return low + size - coordinate if way > 0 else coordinate - low if way < 0 else 0.0
