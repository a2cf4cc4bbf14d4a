"""Defines the ground, and a surface of uneven ground: a grid of heights with materials.

A smooth surface has its heights at nodes (x0 + cell column, y0 + cell row) and is bicubic between
them (smooth.py). A surface of blocks has flat cells with vertical walls between them (blocks.py):
cell (row, column) begins at (x0 + cell column, y0 + cell row). Rows run along +y, columns along +x.
Beyond the map the height of its border goes on, of a smooth surface behind a run-out of its slope.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.schema import Choice, Number

Bytes = NDArray[np.uint8]

TERRAINS = ("flat", "slope", "grid")
PLANES = ("flat", "slope")  # kinds of ground without a surface
KINDS = ("smooth", "blocks")  # numbered from 1 in grid files
MATERIAL_COLUMNS = 16  # numbers of a material, as grid_file.py lists them
MU, MU_STATIC, STIFFNESS, LAW = range(4)  # the first ones; the soil's numbers follow its law
MOST_MATERIALS = 255  # a material is a byte, and 0 is the ground of the definition
NAME_BYTES = 64  # of a name in a grid file, with a final zero
HIGHEST = 100.0  # m    of heights; more is a wrong unit or a wrong scale
LARGEST_CELL = 100.0  # m
SMALLEST_CELL = 1e-3  # m
FARTHEST = 1e4  # m    of the map's edges from the world's origin
LARGEST_MAP = 1 << 26  # nodes; their heights take 512 MB


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A grid of heights; surfaces of equal content are equal. Raises RobotError for invalid data.

    `recipe` holds the keys of [terrain] that the surface was made from, and does not count in
    comparisons.
    """

    kind: str  # of KINDS
    height: Array = field(repr=False)  # (rows, columns) m
    x0: float  # m    of the first column: node, or edge of the cells
    y0: float  # m    of the first row
    cell: float  # m    spacing of nodes, edge of a cell
    name: str = "surface"
    material: Bytes | None = field(default=None, repr=False)  # (rows, columns) 0: the definition's
    materials: Array | None = field(default=None, repr=False)  # (count, 16) of material 1, 2, ...
    recipe: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        height = np.array(self.height, dtype=np.float64) + 0.0  # no -0.0
        object.__setattr__(self, "height", height)
        check_surface(self)
        height.flags.writeable = False
        for key, kind in (("material", np.uint8), ("materials", np.float64)):
            if getattr(self, key) is not None:
                copy = np.array(getattr(self, key), dtype=kind)
                copy.flags.writeable = False
                object.__setattr__(self, key, copy)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self.height.shape[0])

    @property
    def columns(self) -> int:
        """Number of columns."""
        return int(self.height.shape[1])

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """The map's edges [m]: least x, greatest x, least y, greatest y."""
        more = 0 if self.kind == "smooth" else 1
        right = self.x0 + self.cell * (self.columns - 1 + more)
        return self.x0, right, self.y0, self.y0 + self.cell * (self.rows - 1 + more)

    @cached_property
    def digest(self) -> str:
        """SHA-256 in hexadecimal of kind, place, heights and materials, without the name."""
        place = np.array([self.x0, self.y0, self.cell]) + 0.0
        content = hashlib.sha256(f"{self.kind} {self.rows} {self.columns}".encode())
        for part in (place, self.height):
            content.update(part.astype("<f8").tobytes())
        if self.material is not None and self.materials is not None:
            content.update(self.material.tobytes())
            content.update(self.materials.astype("<f8").tobytes())
        return content.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Surface) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def material_at(self, x: float, y: float) -> int:
        """Returns the material at (x, y) [m]: that of the cell, or of the nearest node."""
        if self.material is None:
            return 0
        shift = 0.5 if self.kind == "smooth" else 0.0
        column = math.floor((x - self.x0) / self.cell + shift)
        row = math.floor((y - self.y0) / self.cell + shift)
        row, column = min(max(row, 0), self.rows - 1), min(max(column, 0), self.columns - 1)
        return int(self.material[row, column])


def check_surface(surface: Surface) -> None:
    """Raises RobotError for data of no surface."""
    if surface.kind not in KINDS:
        raise unknown_name("kind of surface", str(surface.kind), KINDS, error=RobotError)
    _check_shape(surface)
    _check_place(surface)
    check_heights(surface.height, surface.name)
    _check_materials(surface)
    if not surface.name or len(surface.name.encode()) >= NAME_BYTES or "\0" in surface.name:
        expected = f"1 to {NAME_BYTES - 1} bytes of UTF-8 text"
        raise RobotError("name of a surface", got=surface.name, expected=expected, fix="shorten it")


def _check_shape(surface: Surface) -> None:
    least = 2 if surface.kind == "smooth" else 1
    shape = surface.height.shape
    if len(shape) != 2 or min(shape) < least:
        what = "the height map is too small"
        got = " x ".join(map(str, shape))
        expected = f"at least {least} rows and {least} columns of a {surface.kind} surface"
        fix = "give a map with more rows and columns"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=surface.name)
    if surface.height.size > LARGEST_MAP:
        what = "the height map is too large"
        got = " x ".join(map(str, shape))
        expected = f"at most {LARGEST_MAP} heights"
        fix = "cut out a part of it or reduce its resolution"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=surface.name)


def _check_place(surface: Surface) -> None:
    if not SMALLEST_CELL <= surface.cell <= LARGEST_CELL:
        what = "scale of the height map"
        expected = f"horizontal_scale from {SMALLEST_CELL:g} to {LARGEST_CELL:g} m for a cell"
        fix = "give horizontal_scale in metres"
        raise RobotError(what, got=surface.cell, expected=expected, fix=fix, where=surface.name)
    if not all(abs(edge) <= FARTHEST for edge in surface.extent):
        what = "place of the height map"
        got = [float(f"{edge:.6g}") for edge in surface.extent]
        expected = f"edges within {FARTHEST:g} m of the world's origin"
        fix = "move it towards the origin, or correct horizontal_scale"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=surface.name)


def check_heights(height: Array, name: str, place: Callable[[int, int], str] | None = None) -> None:
    """Raises RobotError for heights [m] that are not finite or enormous.

    place: returns where (row, column) is in the file that the heights are from; None: row and
    column from 0 on, row 0 at the smallest y.
    """
    bad = np.argwhere(~np.isfinite(height))
    if len(bad):
        row, column = (int(index) for index in bad[0])
        at = place(row, column) if place else f"in row {row}, column {column}"
        more = f", and {len(bad) - 1} more" if len(bad) > 1 else ""
        what = "a height that is no number"
        got = f"{height[row, column]} {at}{more}"
        fix = "fill the holes of the map first"
        raise RobotError(what, got=got, expected="finite heights", fix=fix, where=name)
    worst = float(np.max(np.abs(height)))
    if worst > HIGHEST:
        what = "enormous heights"
        expected = f"at most {HIGHEST:g} m above and below terrain.height"
        fix = "correct vertical_scale, or subtract the map's mean height"
        raise RobotError(what, got=f"{worst:.6g} m", expected=expected, fix=fix, where=name)


def _check_materials(surface: Surface) -> None:
    """Checks that each material of the map is in the table."""
    if surface.material is None and surface.materials is None:
        return
    table = surface.materials
    if surface.material is None or table is None:
        got = "only one of map and table"
        expected = "material and materials, or none of them"
        raise RobotError("materials of a surface", got=got, expected=expected, where=surface.name)
    rows = len(table)
    largest = int(np.max(surface.material)) if np.size(surface.material) else 0
    fits = np.shape(table) == (rows, MATERIAL_COLUMNS) and 0 < rows <= MOST_MATERIALS
    if np.shape(surface.material) != surface.height.shape or not fits or largest > rows:
        raise RobotError(
            "materials of a surface",
            got=f"a map {np.shape(surface.material)} of materials up to {largest}, "
            f"a table {np.shape(table)}",
            expected=f"a map {surface.height.shape} and a table (count, {MATERIAL_COLUMNS})",
            where=surface.name,
        )


@dataclass(frozen=True, kw_only=True)
class Terrain:
    """The ground: level, a slope that rises by `incline` along `heading`, or a surface.

    The heights of a surface are above `height`. Files give the name of the surface as `kind`, which
    is "grid" here.
    """

    kind: Annotated[str, Choice(TERRAINS)]
    height: Annotated[float, Number("m")] = 0.0
    incline: Annotated[float, Number("rad", above=-math.pi / 2, below=math.pi / 2)] = 0.0
    heading: Annotated[float, Number("rad")] = 0.0
    surface: Surface | None = None  # of the kind grid; other kinds do not use it

    @property
    def name(self) -> str:
        """The kind as files give it: flat, slope or the name of a surface."""
        if self.kind != "grid" or self.surface is None:
            return self.kind
        return str(self.surface.recipe.get("kind", self.surface.name))
