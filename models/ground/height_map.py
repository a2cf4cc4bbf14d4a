"""Makes surfaces of height maps from files: grey PNG and NumPy arrays.

The first row of a picture is the northern one, at the largest y; row 0 of an array is at the
smallest y, as in `Surface`. The middle of the map comes to (x, y).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.files import MAP_SIZE, read_bytes
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
from hexapod_cosim.models.ground.valleys import smoothed
from hexapod_cosim.models.schema import Number

NO_MAP = "not a height map"
GREY = ("L", "I;16", "I;16B", "I")  # modes of pictures, 8 or 16 bits per pixel


class HeightFile(NamedTuple):
    """The heights of a file, from the southern row on, and their scale."""

    units: Array  # (rows, columns) in units of `scale`
    scale: float  # m    of a unit; 0: the file has none
    place: Callable[[int, int], str]  # where (row, column) is in the file, for messages


def _read_png(path: Path) -> HeightFile:
    """Returns the grey levels of a picture, which has no scales."""
    # Pillow takes a moment to import, and few robots have height maps
    from PIL import Image  # noqa: PLC0415

    try:
        picture = Image.open(BytesIO(read_bytes(path, MAP_SIZE)), formats=("PNG",))
        levels, mode = np.asarray(picture).astype(np.float64)[::-1], picture.mode
    except OSError:
        if not path.is_file():
            raise
        raise _not_grey(path, "a file of another kind, or one that is cut") from None
    except Exception as error:  # Pillow's readers raise errors of many kinds
        raise _not_grey(path, f"a damaged file ({error})") from error
    if mode not in GREY:
        raise _not_grey(path, f"pixels of the kind {mode}")

    def place(row: int, column: int) -> str:
        return f"in row {len(levels) - row} from above, column {column + 1}"

    return HeightFile(levels, 0.0, place)


def _not_grey(path: Path, got: str) -> RobotError:
    fix = "save the map again in grey, best with 16 bits, or give heights in metres as a .npy array"
    expected = "PNG with 8 or 16 bits of grey per pixel"
    return RobotError(NO_MAP, got=got, expected=expected, fix=fix, where=str(path))


def _read_npy(path: Path) -> HeightFile:
    """Returns a NumPy array; floats are in metres, integers have no scale."""
    with path.open("rb") as file:
        try:
            array = np.load(file, allow_pickle=False)
        except Exception as error:  # the header is Python text: errors of its parser, of memory
            raise _wrong_array(path, f"{type(error).__name__}: {error}") from error
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu" or array.ndim != 2:
        shape = f"{getattr(array, 'ndim', 0)} axes of {getattr(array, 'dtype', type(array))}"
        raise _wrong_array(path, shape)
    scale = 1.0 if array.dtype.kind == "f" else 0.0
    place = "at [{}, {}]".format
    return HeightFile(array.astype(np.float64), scale, place)


def _wrong_array(path: Path, got: str) -> RobotError:
    expected = "an array with two axes (rows along +y, columns along +x) of real numbers"
    fix = "write it with numpy.save"
    return RobotError(NO_MAP, got=got, expected=expected, fix=fix, where=str(path))


READERS: dict[str, Callable[[Path], HeightFile]] = {".png": _read_png, ".npy": _read_npy}


MAPS: Entries = {}


@entry(
    MAPS,
    "Height map from a file",
    {
        "file": text(None, "path of a grey PNG or a .npy array"),
        "horizontal_scale": length(None, "per pixel or cell"),
        "vertical_scale": length(0.0, "per unit of height; 0: the file is in metres", zero=True),
        "slope_threshold": ratio(
            0.0, "steeper maps become blocks; 0: always smooth", least=0.0, most=1e3
        ),
        "smooth": length(0.0, "least radius of valleys, by averages; 0: as it is", zero=True),
        "platform_size": replace(PLATFORM, default=0.0),
        "x": Parameter(spec=Number("m"), default=0.0, about="middle of the map"),
        "y": Parameter(spec=Number("m"), default=0.0, about="middle of the map"),
    },
)
def heightfield(values: SimpleNamespace) -> Surface:
    """Returns the surface of a height map's file.

    values: file, horizontal_scale [m], vertical_scale [m per unit] (0: that of the file),
    slope_threshold (0: always smooth), smooth [m] (0: no), platform_size [m], x, y [m]. Where the
    map is somewhere steeper than the threshold, its values become blocks. Raises RobotError.
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
        fix = "give the path of a .png or .npy file, relative to the TOML file"
        raise RobotError(what, got=got, fix=fix, where=str(path)) from error
    scale = values.vertical_scale or read.scale
    if scale == 0.0:
        what = "a height map without vertical_scale"
        expected = "a scale in m per unit of height"
        fix = "add `vertical_scale = ...` to [terrain]"
        raise RobotError(what, got="none in the file", expected=expected, fix=fix, where=str(path))
    height = read.units * scale
    check_heights(height, str(path), read.place)
    try:
        surface = _surface(path, height, values)
        return smoothed(surface, values.smooth) if values.smooth > 0.0 else surface
    except RobotError as error:
        error.where = str(path)  # the surface knows the map's name alone
        raise


def _surface(path: Path, height: Array, values: SimpleNamespace) -> Surface:
    """Returns the surface of heights [m], smooth or of blocks, with its middle at (x, y)."""
    cell = values.horizontal_scale
    rises = [np.abs(np.diff(height, axis=axis)) for axis in (0, 1)]
    steepest = max(float(np.max(rise, initial=0.0)) for rise in rises) / cell
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
