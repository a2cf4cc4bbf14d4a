"""Makes surfaces of height maps from files: 16-bit PNG, NumPy arrays and ESRI ASCII grids.

The middle of the map comes to (x, y).
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.map_files import READERS
from hexapod_cosim.models.ground.parameters import (
    PLATFORM,
    Entries,
    Parameter,
    entry,
    length,
    ratio,
    text,
)
from hexapod_cosim.models.ground.rough import off_platform
from hexapod_cosim.models.ground.surface import Surface, check_heights
from hexapod_cosim.models.schema import Number

MAPS: Entries = {}


@entry(
    MAPS,
    "Height map from a file",
    {
        "file": text(None, "path of a 16-bit PNG, a .npy array or an ESRI .asc grid"),
        "horizontal_scale": length(0.0, "per pixel or cell; 0: cellsize of the file", zero=True),
        "vertical_scale": length(0.0, "per unit of height; 0: the file is in metres", zero=True),
        "slope_threshold": ratio(
            0.0, "steeper maps become blocks; 0: always smooth", least=0.0, most=1e3
        ),
        "platform_size": replace(PLATFORM, default=0.0),
        "x": Parameter(spec=Number("m"), default=0.0, about="middle of the map"),
        "y": Parameter(spec=Number("m"), default=0.0, about="middle of the map"),
    },
)
def heightfield(values: SimpleNamespace) -> Surface:
    """Returns the surface of a height map's file.

    values: file, horizontal_scale [m] (0: that of the file), vertical_scale [m per unit] (0: that
    of the file), slope_threshold (0: always smooth), platform_size [m], x, y [m]. Where the map is
    somewhere steeper than the threshold, its values become blocks. Raises RobotError.
    """
    path = Path(values.file)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        what = "unknown kind of height map"
        expected = "a file that ends in " + ", ".join(READERS)
        fix = "convert the map"
        raise RobotError(what, got=path.name, expected=expected, fix=fix, where=str(path))
    try:
        read = reader(path)
    except OSError as error:
        what = "cannot read the height map"
        got = error.strerror or str(error)
        fix = "give the path of a .png, .npy or .asc file, relative to the TOML file"
        raise RobotError(what, got=got, fix=fix, where=str(path)) from error
    cell = _chosen(
        "horizontal_scale", "m per pixel or cell", values.horizontal_scale, read.cell, path
    )
    scale = _chosen(
        "vertical_scale", "m per unit of height", values.vertical_scale, read.scale, path
    )
    height = read.units.astype(np.float64) * scale
    _check_size(path, height)
    check_heights(height, str(path), read.place)
    try:
        return _surface(path, height, cell, values)
    except RobotError as error:
        error.where = str(path)  # the surface knows the map's name alone
        raise


def _chosen(key: str, unit: str, given: float, own: float, path: Path) -> float:
    """Returns the given scale, or else the file's own. Raises RobotError without any."""
    scale = given or own
    if scale == 0.0:
        what = f"a height map without {key}"
        expected = f"a scale in {unit}"
        fix = f"add `{key} = ...` to [terrain]"
        raise RobotError(what, got="none in the file", expected=expected, fix=fix, where=str(path))
    if not (math.isfinite(scale) and scale > 0.0):
        what = f"{key} of the height map"
        expected = f"a positive scale in {unit}"
        fix = f"correct `{key}` in [terrain], or the file's cellsize"
        raise RobotError(what, got=scale, expected=expected, fix=fix, where=str(path))
    return scale


def _check_size(path: Path, height: Array) -> None:
    """Raises RobotError for a map without two rows and columns."""
    if height.ndim != 2 or min(height.shape) < 2:
        what = "the height map is too small"
        got = " x ".join(map(str, height.shape))
        expected = "at least 2 rows and 2 columns"
        fix = "give a map with more rows and columns"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=str(path))


def _surface(path: Path, height: Array, cell: float, values: SimpleNamespace) -> Surface:
    """Returns the surface of heights [m], smooth or of blocks, with its middle at (x, y)."""
    steepest = max(float(np.max(np.abs(np.diff(height, axis=axis)))) for axis in (0, 1)) / cell
    blocks = 0.0 < values.slope_threshold < steepest
    rows, columns = height.shape
    shift = 0.0 if not blocks else 0.5
    x = values.x + cell * (np.arange(columns) - 0.5 * (columns - 1))
    y = values.y + cell * (np.arange(rows) - 0.5 * (rows - 1))
    grid = np.meshgrid(x, y)
    height = _flattened(height, grid[0], grid[1], cell, values.platform_size)
    return Surface(
        kind="blocks" if blocks else "smooth",
        height=height,
        x0=float(x[0]) - shift * cell,
        y0=float(y[0]) - shift * cell,
        cell=cell,
        name=path.stem.encode()[:63].decode(errors="ignore") or "heightfield",
    )


def _flattened(height: Array, x: Array, y: Array, cell: float, platform: float) -> Array:
    """Returns the map with the platform levelled to its own mean height."""
    inside = np.maximum(np.abs(x), np.abs(y)) <= 0.5 * platform
    if platform <= 0.0 or not inside.any():
        return height
    level = float(np.mean(height[inside]))
    share = off_platform(x, y, cell, platform)
    return np.where(share < 1.0, level + (height - level) * share, height)
