"""The surface that a run walked on: cut to the neighbourhood of the walk, and stored beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.support import FLAT, GRID
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.ground.faces import ground_height
from hexapod_cosim.models.ground.grid_file import read_grid, surface_from_bytes, write_grid
from hexapod_cosim.models.ground.surface import Surface, Terrain
from hexapod_cosim.models.ground.table import terrain_specs
from hexapod_cosim.models.schema import Number

GROUND = "ground.terrain"  # the grid file in a folder of results
MARGIN = 2.75  # m    of the surface around the torso's path
LEAST_HIGH = 5e-4  # m    of a height that a text gives


def surface_of_grid(content: bytes | None, recipe: Mapping[str, Any]) -> Surface | None:
    """Returns the surface of a grid file, None without one.

    recipe: the keys of [terrain] that made it, if they are known.
    """
    return None if content is None else replace(surface_from_bytes(content), recipe=recipe)


def is_on_surface(parameters: Mapping[str, float]) -> bool:
    """Whether the ground of these FMU parameters is a surface from a grid file."""
    return parameters.get("terrain.kind", FLAT) == GRID


def terrain_of(surface: Surface, parameters: Mapping[str, float]) -> Terrain:
    """Returns the ground of a run on a surface, for `ground_height`."""
    return Terrain(kind="grid", height=parameters.get("terrain.height", 0.0), surface=surface)


def heights_at(surface: Surface, parameters: Mapping[str, float], x: Array, y: Array) -> Array:
    """Returns the world heights [m] of the ground at places (rows,) [m]."""
    terrain = terrain_of(surface, parameters)
    places = zip(x.tolist(), y.tolist(), strict=True)
    return np.array([ground_height(terrain, *place) for place in places]).reshape(len(x))


def around_walk(surface: Surface, recording: Recording, *, margin: float = MARGIN) -> Surface:
    """Returns the part of a surface within a margin [m] of the torso's path, in whole metres.

    Heights within the part are the same; beyond it they differ. A recording without positions or
    rows keeps the whole surface. Whole metres let two walks of a comparison share a part.
    """
    names = ("torso.position[1]", "torso.position[2]")
    if not len(recording.time) or not set(names) <= set(recording.names):
        return surface
    x, y = recording.columns(names).T
    low, high = (
        np.floor([x.min() - margin, y.min() - margin]),
        np.ceil([x.max() + margin, y.max() + margin]),
    )
    return cut(surface, (low[0], high[0]), (low[1], high[1]))


def cut(surface: Surface, x: tuple[float, float], y: tuple[float, float]) -> Surface:
    """Returns the rows and columns of a surface that cover a rectangle [m].

    A smooth surface keeps two more nodes on each side, on which its slopes in the rectangle depend.
    """
    columns = _covering(x, surface.x0, surface.cell, surface.columns)
    rows = _covering(y, surface.y0, surface.cell, surface.rows)
    material = None if surface.material is None else surface.material[rows, columns]
    return replace(
        surface,
        height=surface.height[rows, columns],
        x0=surface.x0 + surface.cell * columns.start,
        y0=surface.y0 + surface.cell * rows.start,
        material=material,
    )


def _covering(limits: tuple[float, float], origin: float, cell: float, count: int) -> slice:
    """Returns the nodes or blocks along one axis that cover the limits, at least two."""
    low, high = ((limit - origin) / cell for limit in limits)
    first = min(max(int(np.floor(low)) - 2, 0), max(count - 2, 0))
    return slice(first, min(max(int(np.ceil(high)) + 3, first + 2), count))


def write_ground(surface: Surface | None, recording: Recording, folder: Path) -> list[Path]:
    """Writes the neighbourhood of the walk as a grid file; returns the file, [] without surface."""
    if surface is None:
        return []
    return [write_grid(around_walk(surface, recording), folder / GROUND)]


def read_ground(folder: Path, recipe: Mapping[str, Any]) -> Surface | None:
    """Reads the surface of a run from its folder; None for a plane. Raises RobotError."""
    path = folder / GROUND
    return replace(read_grid(path), recipe=recipe) if path.is_file() else None


def describe_terrain(surface: Surface | None, parameters: Mapping[str, float]) -> str:
    """Returns the name of a run's ground and the parameters it was made with, as one line."""
    if surface is None:
        if parameters.get("terrain.kind", FLAT) == FLAT:
            return "level plane"
        incline = np.degrees(parameters.get("terrain.incline", 0.0))
        return f"plane with a slope of {incline:.3g} deg"
    recipe = {key: value for key, value in surface.recipe.items() if key not in ("kind", "patch")}
    shown = [f"{key} = {_text(key, value)}" for key, value in recipe.items()]
    patches = len(surface.recipe.get("patch", ()))
    shown += [f"{patches} patch{'es' if patches > 1 else ''}"] if patches else []
    name = str(surface.recipe.get("kind", surface.name))
    low, high = float(surface.height.min()), float(surface.height.max())
    if high - low > LEAST_HIGH:
        shown.append(f"heights from {1e3 * low:.0f} to {1e3 * high:.0f} mm")
    return f"{name} ({', '.join(shown)})" if shown else name


def _text(key: str, value: Any) -> str:
    """Returns a parameter's value with its unit; of a file, the name without its folder."""
    if not isinstance(value, int | float):
        return Path(str(value)).name
    spec = terrain_specs().get(key)
    unit = spec.unit if isinstance(spec, Number) else "1"
    return f"{value:.4g}" + ("" if unit == "1" else f" {unit}")
