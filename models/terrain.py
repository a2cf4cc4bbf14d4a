"""Computes the distance of a point from the ground, and the ground's normal."""

from __future__ import annotations

import numpy as np

from hexapod_cosim.models.records import Array, Terrain


def ground_normal(terrain: Terrain) -> Array:
    """Returns the unit normal (3,) of the ground plane, out of the ground."""
    incline = terrain.incline if terrain.kind == "slope" else 0.0
    uphill = np.array([np.cos(terrain.heading), np.sin(terrain.heading), 0.0])
    normal: Array = np.cos(incline) * np.array([0.0, 0.0, 1.0]) - np.sin(incline) * uphill
    return normal


def ground(terrain: Terrain, point: Array) -> tuple[float, Array]:
    """Returns the signed distance [m] of a world point (3,), positive above the ground, and the
    unit normal (3,).
    """
    normal = ground_normal(terrain)
    return float(normal @ (point - np.array([0.0, 0.0, terrain.height]))), normal
