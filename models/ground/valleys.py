"""Computes the smallest concave radius of curvature of a smooth surface, and enlarges it.

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
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.smooth import CATMULL_ROM
from hexapod_cosim.models.ground.surface import Surface

BAND = 1 << 19  # nodes of a band of rows that is bounded at once
CHUNK = 1 << 12  # cells that are sampled at once
PLACES = np.linspace(0.0, 1.0, 9)  # along each edge of a cell that are sampled
MOST_PASSES = 1 << 12  # of averages by which a map is smoothed


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
        cells = np.argwhere(_bounds(band) > sharpest * surface.cell**2)
        for start in range(0, len(cells), CHUNK):
            chunk = cells[start : start + CHUNK]
            curvature = _curvatures(band, chunk, surface.cell)
            k, u, t = np.unravel_index(int(np.argmax(curvature)), curvature.shape)
            if curvature[k, u, t] > sharpest:
                sharpest = float(curvature[k, u, t])
                row, column = first + chunk[k, 0] + PLACES[u], chunk[k, 1] + PLACES[t]
                found = Valley(
                    radius=1.0 / sharpest,
                    x=surface.x0 + surface.cell * float(column),
                    y=surface.y0 + surface.cell * float(row),
                )
    return found


def smoothed(surface: Surface, radius: float) -> Surface:
    """Returns a surface whose valleys have at least a radius [m].

    Heights are averaged with their neighbours as often as needed, the border's with linear
    extrapolation, so that a plane stays. Raises RobotError where that does not help.
    """
    passes = 1
    while tightest_valley(surface, radius) is not None:
        if passes > MOST_PASSES:
            what = "a map that cannot be smoothed"
            fix = "reduce terrain.smooth or vertical_scale, or enlarge horizontal_scale"
            raise RobotError(what, got=f"smooth {radius:g} m", fix=fix)
        height = surface.height
        for _ in range(passes):
            height = _averaged(_averaged(height).T).T
        surface, passes = replace(surface, height=height), 2 * passes
    return surface


def _averaged(height: Array) -> Array:
    """Returns averages of heights with the weights 1/4, 1/2, 1/4 along the first axis."""
    ring = _with_ring(height)[:, 1:-1]
    return 0.25 * (ring[:-2] + ring[2:]) + 0.5 * ring[1:-1]


def _with_ring(height: Array) -> Array:
    """Returns the nodes with a ring of extrapolated ones around them."""
    return np.pad(height, 1, mode="reflect", reflect_type="odd")


def _bands(height: Array) -> Iterator[tuple[int, Array]]:
    """Yields the first row of a band of cells, and its nodes with a ring of nodes around them."""
    nodes = _with_ring(height)
    step = max(BAND // height.shape[1], 1)
    for first in range(0, len(height) - 1, step):
        yield first, nodes[first : first + step + 3]


def _bounds(band: Array) -> Array:
    """Returns upper bounds of the curvatures of a band's cells (rows, columns) over 1/cell^2.

    The second derivative along x is between 2 D0 - D1 and 2 D1 - D0 of the second differences D of
    its ends, and cubic in y: its weights have magnitudes that sum to 5/4 at most. The weights of a
    slope over three differences have magnitudes that sum to 3/2 at most. Slopes only lower the
    curvature.
    """
    across, along = np.abs(np.diff(band, 2, axis=0)), np.abs(np.diff(band, 2, axis=1))
    twist = np.abs(np.diff(np.diff(band, axis=0), axis=1))
    bend = np.maximum(_largest(across, 2, 4), _largest(along, 4, 2))
    return 3.75 * bend + 2.25 * _largest(twist, 3, 3)


def _largest(values: Array, rows: int, columns: int) -> Array:
    """Returns the largest of each rows x columns neighbouring values."""
    height = sliding_window_view(values, rows, axis=0).max(axis=-1)
    return np.asarray(sliding_window_view(height, columns, axis=1).max(axis=-1))


def _curvatures(band: Array, cells: NDArray[np.intp], cell: float) -> Array:
    """Returns the larger principal curvature [1/m] (cells, places, places) within some cells.

    cells: rows and columns (cells, 2); places are those of PLACES along y and x.
    """
    nodes = sliding_window_view(band, (4, 4))[cells[:, 0], cells[:, 1]]
    zero, one, t = np.zeros_like(PLACES), np.ones_like(PLACES), PLACES
    powers = (
        [one, t, t * t, t**3],
        [zero, one, 2.0 * t, 3.0 * t * t],
        [zero, zero, 2.0 * one, 6.0 * t],
    )
    value, first, second = (CATMULL_ROM @ np.array(rows) for rows in powers)  # (4, places)
    p, q = value.T @ nodes @ first / cell, first.T @ nodes @ value / cell
    xx, yy = value.T @ nodes @ second / cell**2, second.T @ nodes @ value / cell**2
    xy = first.T @ nodes @ first / cell**2
    square = 1.0 + p * p + q * q
    mean = ((1.0 + q * q) * xx - 2.0 * p * q * xy + (1.0 + p * p) * yy) / (2.0 * square**1.5)
    gauss = (xx * yy - xy * xy) / square**2
    return np.asarray(mean + np.sqrt(np.maximum(mean * mean - gauss, 0.0)))
