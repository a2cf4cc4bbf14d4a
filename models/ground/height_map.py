"""Reads height maps from files: 16-bit PNG, NumPy arrays and ESRI ASCII grids.

The first row of a picture and of an ASCII grid is the northern one, at the largest y; row 0 of an
array is at the smallest y, as in `Surface`. The middle of the map comes to (x, y).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.rough import off_platform
from hexapod_cosim.models.ground.surface import Array, Surface, check_heights

SUFFIXES = (".png", ".npy", ".asc")
LEVELS = "PNG with 16 bits of grey per pixel"
ASC_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize")


def heightfield(values: SimpleNamespace) -> Surface:
    """Returns the surface of a height map's file.

    values: file, horizontal_scale [m] (0: that of the file), vertical_scale [m per unit] (0: that
    of the file), slope_threshold (0: always smooth), platform_size [m], x, y [m]. Where the map is
    somewhere steeper than the threshold, its values become blocks. Raises RobotError.
    """
    path = Path(values.file)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise RobotError(
            "unknown kind of height map",
            got=path.name,
            expected="a file that ends in " + ", ".join(SUFFIXES),
            fix="convert the map",
            where=str(path),
        )
    try:
        units, cell, scale = reader(path)
    except OSError as error:
        raise RobotError(
            "cannot read the height map",
            got=error.strerror or str(error),
            fix="give the path of a .png, .npy or .asc file, relative to the TOML file",
            where=str(path),
        ) from error
    cell = _chosen("horizontal_scale", "m per pixel or cell", values.horizontal_scale, cell, path)
    scale = _chosen("vertical_scale", "m per unit of height", values.vertical_scale, scale, path)
    return _surface(path, units.astype(np.float64) * scale, cell, values)


def _chosen(key: str, unit: str, given: float, own: float, path: Path) -> float:
    """Returns the given scale, or else the file's own. Raises RobotError without any."""
    scale = given or own
    if scale == 0.0:
        raise RobotError(
            f"a height map without {key}",
            got="none in the file",
            expected=f"a scale in {unit}",
            fix=f"add `{key} = ...` to [terrain]",
            where=str(path),
        )
    if not (math.isfinite(scale) and scale > 0.0):
        raise RobotError(
            f"{key} of the height map",
            got=scale,
            expected=f"a positive scale in {unit}",
            fix=f"correct `{key}` in [terrain], or the file's cellsize",
            where=str(path),
        )
    return scale


def _surface(path: Path, height: Array, cell: float, values: SimpleNamespace) -> Surface:
    """Returns the surface of heights [m], smooth or of blocks, with its middle at the origin."""
    if height.ndim != 2 or min(height.shape) < 2:
        raise RobotError(
            "the height map is too small",
            got=" x ".join(map(str, height.shape)),
            expected="at least 2 rows and 2 columns",
            fix="give a map with more rows and columns",
            where=str(path),
        )
    check_heights(height, str(path))
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


def _read_png(path: Path) -> tuple[Array, float, float]:
    """Returns the grey levels of a picture, from the southern row on, without scales."""
    # Pillow takes a moment to import, and few robots have height maps
    from PIL import Image, UnidentifiedImageError  # noqa: PLC0415

    with path.open("rb") as file:
        try:
            picture = Image.open(file)
            mode = picture.mode
            if mode in ("I;16", "I;16B", "I"):
                return np.asarray(picture).astype(np.float64)[::-1], 0.0, 0.0
        except UnidentifiedImageError as error:
            raise _wrong_picture(path, "a file of another kind") from error
        except Exception as error:  # Pillow's readers raise errors of many kinds
            raise _wrong_picture(path, f"a damaged file ({error})") from error
    bits = {"1": "1 bit of grey", "L": "8 bits of grey", "P": "a palette of colours"}
    raise _wrong_picture(path, bits.get(mode, f"colours or transparency ({mode})"))


def _wrong_picture(path: Path, got: str) -> RobotError:
    return RobotError(
        "not a height map",
        got=got,
        expected=LEVELS,
        fix="save the map as 16-bit greyscale, or give heights in metres as a .npy array",
        where=str(path),
    )


def _read_npy(path: Path) -> tuple[Array, float, float]:
    """Returns a NumPy array; floats are in metres, integers have no scale."""
    with path.open("rb") as file:
        try:
            array = np.load(file, allow_pickle=False)
        except Exception as error:  # the header is Python text: errors of its parser, of memory
            raise _wrong_array(path, f"{type(error).__name__}: {error}") from error
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu" or array.ndim != 2:
        shape = f"{getattr(array, 'ndim', 0)} axes of {getattr(array, 'dtype', type(array))}"
        raise _wrong_array(path, shape)
    return array.astype(np.float64), 0.0, 1.0 if array.dtype.kind == "f" else 0.0


def _wrong_array(path: Path, got: str) -> RobotError:
    return RobotError(
        "not a height map",
        got=got,
        expected="an array with two axes (rows along +y, columns along +x) of real numbers",
        fix="write it with numpy.save",
        where=str(path),
    )


def _read_asc(path: Path) -> tuple[Array, float, float]:
    """Returns an ESRI ASCII grid in metres, from the southern row on, and its cellsize [m]."""
    try:
        words = path.read_text(encoding="ascii").split()
    except UnicodeDecodeError as error:
        raise _wrong_grid(path, "bytes that are no text") from error
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
    return values.reshape(rows, columns)[::-1], header.get("cellsize", 0.0), 1.0


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _wrong_grid(path: Path, got: str) -> RobotError:
    return RobotError(
        "not an ESRI ASCII grid",
        got=got,
        expected="ncols, nrows, cellsize and then nrows x ncols heights in metres",
        fix="export the map again from the tool that made it",
        where=str(path),
    )


_READERS: dict[str, Callable[[Path], tuple[Array, float, float]]] = {
    ".png": _read_png,
    ".npy": _read_npy,
    ".asc": _read_asc,
}
