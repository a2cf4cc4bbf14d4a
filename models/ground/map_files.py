"""Reads the heights of files: 16-bit PNG, NumPy arrays and ESRI ASCII grids.

The first row of a picture and of an ASCII grid is the northern one, at the largest y; row 0 of an
array is at the smallest y, as in `Surface`.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.files import MAP_SIZE, read_bytes

LEVELS = "PNG with 16 bits of grey per pixel"
PNG_BEGIN = b"\x89PNG\r\n\x1a\n"
PNG_KINDS = {
    0: "grey",
    2: "colours",
    3: "a palette of colours",
    4: "grey with transparency",
    6: "colours with transparency",
}
ASC_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize")


class HeightFile(NamedTuple):
    """The heights of a file, from the southern row on, and its scales."""

    units: Array  # (rows, columns) in units of `scale`
    cell: float  # m    spacing; 0: the file has none
    scale: float  # m    of a unit; 0: the file has none
    place: Callable[[int, int], str]  # where (row, column) is in the file, for messages


def _read_png(path: Path) -> HeightFile:
    """Returns the grey levels of a picture, which has no scales."""
    # Pillow takes a moment to import, and few robots have height maps
    from PIL import Image, UnidentifiedImageError  # noqa: PLC0415

    content = read_bytes(path, MAP_SIZE)
    if damage := _damage(content):
        raise _wrong_picture(path, damage)
    with path.open("rb") as file:
        try:
            picture = Image.open(file, formats=("PNG",))
            if picture.mode in ("I;16", "I;16B", "I"):
                levels = np.asarray(picture).astype(np.float64)[::-1]
                return HeightFile(levels, 0.0, 0.0, _place_in_picture(len(levels)))
        except UnidentifiedImageError as error:
            raise _wrong_picture(path, "a file of another kind") from error
        except Exception as error:  # Pillow's readers raise errors of many kinds
            raise _wrong_picture(path, f"a damaged file ({error})") from error
    raise _wrong_picture(path, _pixels(content))


def _pixels(content: bytes) -> str:
    """Returns what a PNG file's pixels are, by its header (PNG specification, 11.2.2), because
    Pillow gives 16 bits of grey with transparency as colours.
    """
    depth, kind = content[24], content[25]
    return f"{depth} bit{'s' if depth > 1 else ''} of {PNG_KINDS.get(kind, f'kind {kind}')}"


def _place_in_picture(rows: int) -> Callable[[int, int], str]:
    return lambda row, column: f"in row {rows - row} from above, column {column + 1}"


def _damage(content: bytes) -> str:
    """Returns what is wrong with the chunks of a PNG file; "" where they are whole.

    A chunk is its length, its type, as many bytes, and their CRC-32 (PNG specification, 5.3); the
    last one is IEND. Pillow reads a picture whose file ends behind the pixels.
    """
    if not content.startswith(PNG_BEGIN):
        return ""  # Pillow names files of other kinds
    at, kind = len(PNG_BEGIN), b""
    while kind != b"IEND":
        length = int.from_bytes(content[at : at + 4], "big")
        end = at + 12 + length
        if end > len(content):
            return f"a file that is cut: {len(content)} bytes, without its end (the chunk IEND)"
        kind, body = content[at + 4 : at + 8], content[at + 4 : end - 4]
        if zlib.crc32(body) != int.from_bytes(content[end - 4 : end], "big"):
            return f"a damaged file (the checksum of the chunk {kind.decode('latin-1')} is wrong)"
        at = end
    return ""


def _wrong_picture(path: Path, got: str) -> RobotError:
    return RobotError(
        "not a height map",
        got=got,
        expected=LEVELS,
        fix="save the map again as 16-bit greyscale, or give heights in metres as a .npy array",
        where=str(path),
    )


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
    return RobotError(
        "not a height map",
        got=got,
        expected="an array with two axes (rows along +y, columns along +x) of real numbers",
        fix="write it with numpy.save",
        where=str(path),
    )


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
        bad = next((k for k in range(begin, len(words)) if not _is_number(words[k])), begin)
        raise _wrong_grid(path, f"{words[bad]!r} {_place_of_word(text, bad)}") from error
    if values.size != rows * columns or rows < 1:
        got = f"{values.size} heights for {rows} rows of {columns}"
        raise _wrong_grid(path, got + _uneven_line(text, begin, columns))
    values = np.where(values == header.get("nodata_value", -9999.0), math.nan, values)

    def place(row: int, column: int) -> str:
        return _place_of_word(text, begin + (rows - 1 - row) * columns + column)

    return HeightFile(values.reshape(rows, columns)[::-1], header.get("cellsize", 0.0), 1.0, place)


def _place_of_word(text: str, index: int) -> str:
    """Returns the place of a word, by its index from 0, as an editor shows it: from 1 on."""
    for number, line in enumerate(text.splitlines(), start=1):
        count = len(line.split())
        if index < count:
            return f"in line {number} of the file, number {index + 1}"
        index -= count
    return "at the end of the file"


def _uneven_line(text: str, begin: int, columns: int) -> str:
    """Returns which line behind the header is the first that has not a row's count of numbers.

    begin: words of the header. It is "" where rows are not lines.
    """
    seen = 0
    for number, line in enumerate(text.splitlines(), start=1):
        count = len(line.split())
        seen += count
        if seen > begin and count not in (0, columns):
            return f"; line {number} of the file has {count} numbers"
    return ""


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


READERS: dict[str, Callable[[Path], HeightFile]] = {
    ".png": _read_png,
    ".npy": _read_npy,
    ".asc": _read_asc,
}
