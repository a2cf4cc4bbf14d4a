"""Computes the smallest concave radius of curvature of a smooth surface.

A sphere of radius R that touches a surface has one nearest point, and its force changes without a
jump, where no valley is narrower than the sphere: every principal curvature (positive where the
surface bends up) has to be below 1/R. The condition is local, but enough: the offset of a graph by
R along its normals is then an immersion with upward normals, hence a graph again, so that each
centre above it belongs to one point of the surface.

Cells of which an upper bound of the curvature is below the limit are left out. The others are
sampled, each from its own side, because second derivatives jump at the borders of cells. Beyond the
map's border, where its slope s runs out with the radius 30 mm/s at least, nothing is computed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.smooth import CATMULL_ROM
from hexapod_cosim.models.ground.surface import Surface

TILE = 1 << 19  # nodes of a band of rows that is bounded at once
CHUNK = 1 << 14  # cells that are sampled at once
SAMPLES = 5  # places along each edge of a cell: corners, middle, quarters
ROUNDS = 8  # of samples around the sharpest place of a cell, each at half the distance
PROMISING = 0.7  # of the largest curvature sampled: cells below it are not searched further


@dataclass(frozen=True)
class Valley:
    """The place of the smallest concave radius of a surface."""

    radius: float  # m
    x: float  # m
    y: float  # m


@lru_cache(maxsize=8)
def tightest_valley(surface: Surface, limit: float) -> Valley | None:
    """Returns the valley of the smallest radius [m] if it is below a limit [m], else None.

    Blocks have no valleys.
    """
    if surface.kind != "smooth":
        return None
    sharpest, found = 1.0 / limit, None
    for first, band in _bands(surface.height):
        bound = _bounds(band, surface.cell, sharpest)
        cells = np.argwhere(bound > sharpest)
        cells = cells[np.argsort(-bound[tuple(cells.T)], kind="stable")]
        for start in range(0, len(cells), CHUNK):
            chunk = cells[start : start + CHUNK]
            chunk = chunk[bound[tuple(chunk.T)] > sharpest]
            if not len(chunk):
                break
            curvature, (row, column) = _sharpest(band, chunk, surface.cell, sharpest)
            if curvature > sharpest:
                sharpest = curvature
                found = Valley(
                    radius=1.0 / curvature,
                    x=surface.x0 + surface.cell * float(column),
                    y=surface.y0 + surface.cell * (first + float(row)),
                )
    return found


def _bands(height: Array) -> Iterator[tuple[int, Array]]:
    """Yields the first row of a band of rows, and its nodes with a ring of nodes around them.

    Nodes beyond the border follow from linear extrapolation. Bands share a row of nodes.
    """
    rows, columns = height.shape
    step = max(TILE // columns, 1)
    for first in range(0, rows - 1, step):
        last = min(first + step, rows - 1)
        band = np.empty((last - first + 3, columns + 2))
        low, high = max(first - 1, 0), min(last + 2, rows)
        band[low - first + 1 : high - first + 1, 1:-1] = height[low:high]
        if low == first:
            band[0, 1:-1] = 2.0 * height[0] - height[1]
        if high == last + 1:
            band[-1, 1:-1] = 2.0 * height[-1] - height[-2]
        band[:, 0] = 2.0 * band[:, 1] - band[:, 2]
        band[:, -1] = 2.0 * band[:, -2] - band[:, -3]
        yield first, band


def _bounds(band: Array, cell: float, least: float) -> Array:
    """Returns upper bounds (rows, columns) [1/m] of the curvatures of the cells of a band.

    Where all of the band is below `least` [1/m], its cells share one bound. Second derivatives by
    one coordinate are cubic in the other: their weights sum to 1, and the negative ones to -1/8 at
    most. The weights of a slope over three differences have absolute values that sum to 3/2 at
    most. Slopes only lower the curvature.
    """
    shape = (band.shape[0] - 3, band.shape[1] - 3)
    across, along = np.diff(band, 2, axis=0), np.diff(band, 2, axis=1)
    twist = np.abs(np.diff(np.diff(band, axis=0), axis=1))
    rough = 3.75 * max(np.abs(across).max(), np.abs(along).max()) + 2.25 * twist.max()
    if rough <= least * cell**2:
        return np.full(shape, rough / cell**2)
    bend_y, bend_x = _largest_bend(across), _largest_bend(along.T).T
    mixed = 2.25 * _maximum(_maximum(twist, 3).T, 3).T
    middle, half = 0.5 * (bend_x + bend_y), 0.5 * (bend_x - bend_y)
    return np.asarray((middle + np.hypot(half, mixed)) / cell**2)


def _largest_bend(bend: Array) -> Array:
    """Returns upper bounds (cells, cells) of the second derivative along the first axis.

    bend: second differences (nodes, nodes with ring) along that axis. A Catmull-Rom cubic between
    differences D0 and D1 has the second derivatives 2 D0 - D1 and 2 D1 - D0 at its ends.
    """
    begin, end = 2.0 * bend[:-1] - bend[1:], 2.0 * bend[1:] - bend[:-1]
    largest = _maximum(np.maximum(begin, end).T, 4).T
    smallest = -_maximum(-np.minimum(begin, end).T, 4).T
    return np.asarray(1.125 * largest - 0.125 * smallest)


def _maximum(values: Array, width: int) -> Array:
    """Returns the largest of each `width` consecutive values along the first axis."""
    count = len(values) - width + 1
    found = values[:count]
    for shift in range(1, width):
        found = np.maximum(found, values[shift : shift + count])
    return found


def _sharpest(band: Array, cells: Array, cell: float, least: float) -> tuple[float, Array]:
    """Returns the largest curvature [1/m] of some cells, and its row and column (2,) in the band.

    cells: rows and columns (cells, 2). Cells are sampled on a grid; those that come near the
    largest curvature, or `least` [1/m], are searched around their best place on finer grids.
    """
    middle, half = np.full((len(cells), 2), 0.5), 0.5  # row and column in each cell
    offsets = np.linspace(-1.0, 1.0, SAMPLES)
    for _ in range(ROUNDS):
        places = np.clip(middle[:, :, None] + half * offsets, 0.0, 1.0)
        curvature = _curvature(band, cells, places, cell).reshape(len(cells), -1)
        best, largest = curvature.argmax(axis=1), curvature.max(axis=1)
        u, t = np.divmod(best, SAMPLES)
        number = np.arange(len(cells))
        middle = np.stack([places[number, 0, u], places[number, 1, t]], axis=1)
        kept = largest >= PROMISING * max(least, float(largest.max()))
        if not kept.any():
            break
        cells, middle, largest = cells[kept], middle[kept], largest[kept]
        half *= 0.5
    top = int(np.argmax(largest))
    return float(largest[top]), cells[top] + middle[top]


def _curvature(band: Array, cells: Array, places: Array, cell: float) -> Array:
    """Returns the larger principal curvature [1/m] at a grid of places in each cell.

    places: of rows and columns in each cell, 0 to 1 (cells, 2, places). Shape of the result:
    (cells, places, places).
    """
    window = np.arange(4)
    nodes = band[cells[:, :1, None] + window[:, None], cells[:, 1:, None] + window]
    zero, one = np.zeros_like(places), np.ones_like(places)
    powers = (
        [one, places, places**2, places**3],
        [zero, one, 2.0 * places, 3.0 * places**2],
        [zero, zero, 2.0 * one, 6.0 * places],
    )
    # (derivative, cells, row or column, weights of nodes, places)
    weights = CATMULL_ROM @ np.stack([np.stack(power, axis=2) for power in powers])
    rows, columns = weights[:, :, 0].swapaxes(-1, -2), weights[:, :, 1]
    p, q = rows[0] @ nodes @ columns[1] / cell, rows[1] @ nodes @ columns[0] / cell
    xx, xy, yy = (rows[k] @ nodes @ columns[2 - k] / cell**2 for k in range(3))
    square = 1.0 + p * p + q * q
    mean = ((1.0 + q * q) * xx - 2.0 * p * q * xy + (1.0 + p * p) * yy) / (2.0 * square**1.5)
    gauss = (xx * yy - xy * xy) / square**2
    return np.asarray(mean + np.sqrt(np.maximum(mean * mean - gauss, 0.0)))
