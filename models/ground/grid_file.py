"""Writes and reads grid files: a surface as the plant reads it from an FMU's resources.

Little-endian: the magic bytes hxGrid01; int64 rows, columns, kind (1 smooth, 2 blocks), count of
materials; float64 x0, y0, cell; 64 bytes of name; float64 height[rows][columns]. With materials:
uint8 material[rows][columns], zeros up to a multiple of 8 bytes, float64 table[count][16].

Columns of the table: 0 mu, 1 mu_static, 2 stiffness (NaN: as the definition has it), 3 soil law,
4 to 15 parameters of the soil law.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.files import MAP_SIZE, read_bytes
from hexapod_cosim.models.ground.surface import (
    KINDS,
    LARGEST_MAP,
    MATERIAL_COLUMNS,
    MOST_MATERIALS,
    NAME_BYTES,
    Surface,
)

MAGIC = b"hxGrid01"
HEADER = struct.Struct(f"<8s4q3d{NAME_BYTES}s")


def grid_bytes(surface: Surface) -> bytes:
    """Returns the content of a surface's grid file."""
    count = 0 if surface.materials is None else len(surface.materials)
    head = HEADER.pack(
        MAGIC,
        surface.rows,
        surface.columns,
        1 + KINDS.index(surface.kind),
        count,
        surface.x0,
        surface.y0,
        surface.cell,
        surface.name.encode(),
    )
    content = head + surface.height.astype("<f8").tobytes()
    if surface.material is None or surface.materials is None:
        return content
    padding = bytes(-surface.material.size % 8)
    table = surface.materials.astype("<f8").tobytes()
    return content + surface.material.tobytes() + padding + table


def surface_from_bytes(content: bytes, *, where: str = "grid file") -> Surface:
    """Returns the surface of a grid file's content. Raises RobotError for any other content."""
    if len(content) < HEADER.size or not content.startswith(MAGIC):
        raise _damaged(where, got=f"{len(content)} bytes that begin with {content[:8]!r}")
    _, rows, columns, kind, count, x0, y0, cell, name = HEADER.unpack_from(content)
    if not (1 <= kind <= len(KINDS) and 0 <= count <= MOST_MATERIALS):
        raise _damaged(where, got=f"kind {kind}, {count} materials")
    if rows < 1 or columns < 1 or rows * columns > LARGEST_MAP:
        raise _damaged(where, got=f"{rows} x {columns} heights")
    padded = -(-rows * columns // 8) * 8 if count else 0
    size = HEADER.size + 8 * rows * columns + padded + 8 * MATERIAL_COLUMNS * count
    if len(content) != size:
        raise _damaged(where, got=f"{len(content)} bytes instead of {size}")
    shape, offset = (rows, columns), HEADER.size
    height = np.frombuffer(content, "<f8", rows * columns, offset).reshape(shape)
    material = table = None
    if count:
        offset += height.nbytes
        material = np.frombuffer(content, "u1", rows * columns, offset).reshape(shape)
        table = np.frombuffer(content, "<f8", MATERIAL_COLUMNS * count, offset + padded)
        table = table.reshape(count, MATERIAL_COLUMNS)
    return Surface(
        kind=KINDS[kind - 1],
        height=height,
        x0=x0,
        y0=y0,
        cell=cell,
        name=name.rstrip(b"\0").decode(errors="replace"),
        material=material,
        materials=table,
    )


def write_grid(surface: Surface, path: Path) -> Path:
    """Writes a surface's grid file and returns its path."""
    path.write_bytes(grid_bytes(surface))
    return path


def read_grid(path: Path) -> Surface:
    """Reads a grid file. Raises RobotError for a file that is none."""
    try:
        content = read_bytes(path, MAP_SIZE)
    except OSError as error:
        what = "cannot read the grid file"
        fix = "give the path of a .terrain file"
        raise RobotError(what, got=error.strerror, fix=fix, where=str(path)) from error
    return surface_from_bytes(content, where=str(path))


def _damaged(where: str, *, got: str) -> RobotError:
    """Returns the exception for content of no grid file."""
    expected = "an undamaged grid file of version 1, which begins with hxGrid01"
    fix = "export the FMU again"
    return RobotError("not a grid file", got=got, expected=expected, fix=fix, where=where)
