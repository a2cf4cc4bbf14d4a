"""The ground: signed distance of a point and the normal there (docs/equations.md, contact)."""

from __future__ import annotations

import numpy as np

from hexapod_cosim.models.records import Array, Terrain


def ground_normal(terrain: Terrain) -> Array:
    """(3,) unit normal of the plane, away from the ground; a slope rises by `incline` along
    `heading`.
    """
    incline = terrain.incline if terrain.kind == "slope" else 0.0
    uphill = np.array([np.cos(terrain.heading), np.sin(terrain.heading), 0.0])
    normal: Array = np.cos(incline) * np.array([0.0, 0.0, 1.0]) - np.sin(incline) * uphill
    return normal


def ground(terrain: Terrain, point: Array) -> tuple[float, Array]:
    """Signed distance [m] of a world point (3,), positive above ground, and the unit normal (3,)
    there.
    """
    normal = ground_normal(terrain)
    return float(normal @ (point - np.array([0.0, 0.0, terrain.height]))), normal
