"""Makes surfaces of height maps from files: 16-bit PNG, NumPy arrays and ESRI ASCII grids.

The first row of a picture and of an ASCII grid is the northern one, at the largest y; row 0 of an
array is at the smallest y, as in `Surface`. The middle of the map comes to (x, y).
"""

from __future__ import annotations

import math
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
from hexapod_cosim.models.schema import Number

NO_MAP = "not a height map"
ASC_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize")


class HeightFile(NamedTuple):
    """The heights of a file, from the southern row on, and its scales."""

    units: Array  # (rows, columns) in units of `scale`
    cell: float  # m    spacing; 0: the file has none
    scale: float  # m    of a unit; 0: the file has none
    place: Callable[[int, int], str]  # where (row, column) is in the file, for messages


def _refused(path: Path, what: str, got: str, expected: str, fix: str) -> RobotError:
    """Returns the exception for a file of another content."""
    return RobotError(what, got=got, expected=expected, fix=fix, where=str(path))


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
    if mode not in ("I;16", "I;16B", "I"):
        raise _not_grey(path, f"pixels of the kind {mode}")

    def place(row: int, column: int) -> str:
        return f"in row {len(levels) - row} from above, column {column + 1}"

    return HeightFile(levels, 0.0, 0.0, place)


def _not_grey(path: Path, got: str) -> RobotError:
    fix = "save the map again as 16-bit greyscale, or give heights in metres as a .npy array"
    return _refused(path, NO_MAP, got, "PNG with 16 bits of grey per pixel", fix)


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
    return HeightFile(
        array.astype(np.float64), 0.0, scale, lambda row, column: f"at [{row}, {column}]"
    )


def _wrong_array(path: Path, got: str) -> RobotError:
    expected = "an array with two axes (rows along +y, columns along +x) of real numbers"
    return _refused(path, NO_MAP, got, expected, "write it with numpy.save")


def _read_asc(path: Path) -> HeightFile:
    """Returns the heights of an ESRI ASCII grid in metres, and its cellsize [m]."""
    try:
        text = read_bytes(path, MAP_SIZE).decode("ascii")
    except UnicodeDecodeError as error:
        raise _wrong_grid(path, "bytes that are no text") from error
    words = text.split()
    header, begin = dict[str, float](), 0
    while begin + 1 < len(words) and words[begin][0].isalpha() and _is_number(words[begin + 1]):
        header[words[begin].lower()] = float(words[begin + 1])
        begin += 2
    unknown = sorted(set(header) - {*ASC_KEYS, "nodata_value"})
    if unknown or not {"ncols", "nrows"} <= set(header):
        raise _wrong_grid(path, f"the header {', '.join(header) or 'without keys'}")
    if not all(math.isfinite(header.get(key, 0.0)) for key in ASC_KEYS):
        raise _wrong_grid(path, "a header with numbers that are not finite")
    rows, columns = round(header["nrows"]), round(header["ncols"])
    try:
        values = np.array(words[begin:], dtype=np.float64)
    except ValueError as error:
        raise _wrong_grid(path, str(error)) from error
    if values.size != rows * columns or rows < 1:
        raise _wrong_grid(path, f"{values.size} heights for {rows} rows of {columns}")
    values = np.where(values == header.get("nodata_value", -9999.0), math.nan, values)

    def place(row: int, column: int) -> str:
        return f"in row {rows - row} of the grid, number {column + 1}"

    return HeightFile(values.reshape(rows, columns)[::-1], header.get("cellsize", 0.0), 1.0, place)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _wrong_grid(path: Path, got: str) -> RobotError:
    expected = "ncols, nrows, cellsize and then nrows x ncols heights in metres"
    fix = "export the map again from the tool that made it"
    return _refused(path, "not an ESRI ASCII grid", got, expected, fix)


READERS: dict[str, Callable[[Path], HeightFile]] = {
    ".png": _read_png,
    ".npy": _read_npy,
    ".asc": _read_asc,
}


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
