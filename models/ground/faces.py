"""Computes the distance of a point from the ground, and the ground's normal."""

from __future__ import annotations

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.blocks import (
    FACES,
    TOP,
    Cell,
    block_face,
    block_faces,
    block_height,
    block_heights,
    cell_at,
)
from hexapod_cosim.models.ground.smooth import height_and_slopes, heights_at, smooth_distance
from hexapod_cosim.models.ground.surface import Surface, Terrain

Face = tuple[float, Array]  # distance [m], positive above the ground, and unit normal (3,)


def surface_of(terrain: Terrain) -> Surface | None:
    """Returns the surface of a ground of the kind grid, None for a plane."""
    return terrain.surface if terrain.kind == "grid" else None


def blocks_of(terrain: Terrain) -> Surface | None:
    """Returns the surface of a ground of blocks, None for another ground."""
    surface = surface_of(terrain)
    return surface if surface is not None and surface.kind == "blocks" else None


def ground_normal(terrain: Terrain) -> Array:
    """Returns the unit normal (3,) of the ground plane, out of the ground.

    It is upward for a surface, whose normal depends on the place.
    """
    incline = terrain.incline if terrain.kind == "slope" else 0.0
    uphill = np.array([np.cos(terrain.heading), np.sin(terrain.heading), 0.0])
    normal: Array = np.cos(incline) * np.array([0.0, 0.0, 1.0]) - np.sin(incline) * uphill
    return normal


def ground_height(terrain: Terrain, x: float, y: float) -> float:
    """Returns the world height [m] of the ground at (x, y) [m]."""
    surface = surface_of(terrain)
    if surface is None:
        normal = ground_normal(terrain)
        return terrain.height - float(normal[0] * x + normal[1] * y) / float(normal[2])
    if surface.kind == "blocks":
        return terrain.height + block_height(surface, x, y)
    return terrain.height + height_and_slopes(surface, x, y)[0]


def surface_heights(surface: Surface, x: Array, y: Array) -> Array:
    """Returns the heights (y, x) [m] of a surface at all pairs of x and y [m]."""
    if surface.kind == "blocks":
        return block_heights(surface, x, y)
    return heights_at(surface, x, y)


def ground_faces(terrain: Terrain, point: Array) -> list[Face]:
    """Returns the faces of the ground that a sphere around a world point (3,) may touch.

    The first is the plane, the smooth surface or the top of the block below the point. A second one
    is the nearest wall, edge or corner of higher blocks beside the point.
    """
    above = point - np.array([0.0, 0.0, terrain.height])
    surface = surface_of(terrain)
    if surface is None:
        normal = ground_normal(terrain)
        return [(float(normal @ above), normal)]
    return (
        block_faces(surface, above)
        if surface.kind == "blocks"
        else [smooth_distance(surface, above)]
    )


def faces_of_feet(terrain: Terrain) -> tuple[str, ...]:
    """Returns the kinds of faces that a foot may touch at once, first that of the ground below."""
    return (TOP,) if blocks_of(terrain) is None else FACES


def ground_face(terrain: Terrain, point: Array, kind: str, cell: Cell | None) -> Face | None:
    """Returns one face of the ground at a world point (3,), of a kind of `faces_of_feet`.

    cell: of blocks around which the faces are, None: that below the point. Returns None for a wall
    that is not there.
    """
    surface = blocks_of(terrain)
    if surface is None:
        return ground_faces(terrain, point)[0]
    above = point - np.array([0.0, 0.0, terrain.height])
    around = cell_at(surface, float(point[0]), float(point[1])) if cell is None else cell
    return block_face(surface, above, kind, around)


def ground(terrain: Terrain, point: Array) -> Face:
    """Returns the signed distance [m] of a world point (3,) from the nearest face of the ground,
    positive above it, and the face's unit normal (3,).
    """
    return min(ground_faces(terrain, point), key=lambda face: face[0])
