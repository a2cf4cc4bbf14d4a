"""Computes the traces of contacts in soil: plastic depths at the ends of steps, and footprints.

The fast form is plant_fmu/src/lanes/soil_path.h and plant_fmu/src/ground/footprints.c.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.forces import Candidate, Contacts
from hexapod_cosim.models.ground.blocks import cell_at
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.records import Robot

LEAST_FOOTPRINT = 1e-6  # m  shallower ones are not kept


def deepest(start: float, slope_start: float, end: float, slope_end: float) -> float:
    """Returns the largest value on [0, 1] of the cubic with these ends and slopes (eq. 28)."""
    if not (slope_start > 0.0 and slope_end < 0.0):
        return max(start, end)
    bend = slope_start + slope_end - 2.0 * (end - start)
    curve = end - start - slope_start - bend
    low, high = 0.0, 1.0
    for _ in range(60):
        x = 0.5 * (low + high)
        rises = slope_start + x * (2.0 * curve + 3.0 * x * bend) > 0.0
        low, high = (x, high) if rises else (low, x)
    top = start + low * (slope_start + low * (curve + low * bend))
    return max(top, start, end)


def place_of_footprint(robot: Robot, contacts: Contacts, point: Candidate, centre: Array) -> Array:
    """Returns where (2,) [m] a sphere loses the bottom of its footprint; of a foot that keeps its
    block, the nearest place over that block.
    """
    surface, place = surface_of(robot.terrain), centre[:2]
    cell = contacts.cell[point.leg] if point.leg >= 0 else None
    if surface is None or cell is None:
        return place
    if surface.height[cell_at(surface, *place.tolist())] == surface.height[cell]:
        return place
    corner = np.array([surface.x0, surface.y0]) + surface.cell * np.array(cell[::-1])
    rim = 1e-6 * surface.cell
    return np.clip(place, corner + rim, corner + surface.cell - rim)


def footprint_depth(footprints: Array, centre: Array, surface: Surface | None = None) -> float:
    """Returns the depth [m] of the deepest footprint around a point; 0 outside of all.

    On blocks those on blocks of another height do not count.
    """
    away = np.hypot(footprints[:, 0] - centre[0], footprints[:, 1] - centre[1])
    inside = footprints[away <= footprints[:, 3]]
    if surface is not None and surface.kind == "blocks":
        own = surface.height[cell_at(surface, float(centre[0]), float(centre[1]))]
        level = [surface.height[cell_at(surface, x, y)] == own for x, y in inside[:, :2].tolist()]
        inside = inside[np.array(level, dtype=bool)]
    return float(np.max(inside[:, 2], initial=0.0))
