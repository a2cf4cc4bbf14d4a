"""Every number of a grid file that is out of its range is refused by its name."""

from __future__ import annotations

import ctypes as ct
import struct

import numpy as np
import pytest
from grids import BLOCKS, SMOOTH, Ground, grid_bytes

HEAD = struct.Struct("<8s4q3d64s")
NAN, INFINITE = float("nan"), float("inf")
ROWS, COLS, KIND, MATERIALS, X0, Y0, CELL = range(1, 8)  # their places in the head


def with_head(place: int, value: float, kind: int = SMOOTH) -> bytes:
    """Returns a grid file of 3 x 4 heights with another number in its head."""
    file = grid_bytes(np.zeros((3, 4)), cell=0.1, kind=kind)
    head = list(HEAD.unpack_from(file))
    head[place] = value
    return HEAD.pack(*head) + file[HEAD.size :]


@pytest.mark.parametrize(
    ("place", "value", "kind", "said"),
    [
        (KIND, 0, SMOOTH, "kind: got 0, expected 1 (smooth) or 2 (blocks)"),
        (KIND, 3, SMOOTH, "kind: got 3, expected 1 (smooth) or 2 (blocks)"),
        (ROWS, 1, SMOOTH, "rows: got 1, expected 2 to 1048576 for a smooth surface"),
        (ROWS, 0, BLOCKS, "rows: got 0, expected 1 to 1048576"),
        (ROWS, 1048577, BLOCKS, "rows: got 1048577, expected 1 to 1048576"),
        (ROWS, 1048577, SMOOTH, "rows: got 1048577, expected 2 to 1048576 for a smooth surface"),
        (COLS, 1, SMOOTH, "cols: got 1, expected 2 to 1048576 for a smooth surface"),
        (COLS, -1, BLOCKS, "cols: got -1, expected 1 to 1048576"),
        (COLS, 1048577, SMOOTH, "cols: got 1048577, expected 2 to 1048576 for a smooth surface"),
        (COLS, 1048577, BLOCKS, "cols: got 1048577, expected 1 to 1048576"),
        (MATERIALS, -1, BLOCKS, "materials: got -1, expected 0 to 255"),
        (MATERIALS, 256, BLOCKS, "materials: got 256, expected 0 to 255"),
        (X0, NAN, SMOOTH, "x0: got nan, expected -1e6 to 1e6 m"),
        (X0, -1.1e6, SMOOTH, "x0: got -1100000, expected -1e6 to 1e6 m"),
        (Y0, INFINITE, SMOOTH, "y0: got inf, expected -1e6 to 1e6 m"),
        (Y0, -INFINITE, SMOOTH, "y0: got -inf, expected -1e6 to 1e6 m"),
        (CELL, 0.0, SMOOTH, "cell: got 0, expected 1e-4 to 1000 m"),
        (CELL, 1001.0, SMOOTH, "cell: got 1001, expected 1e-4 to 1000 m"),
    ],
)
def test_a_number_of_the_head_out_of_its_range_is_named(
    core: ct.CDLL, place: int, value: float, kind: int, said: str
) -> None:
    with pytest.raises(ValueError, match="terrain grid") as caught:
        Ground(core, with_head(place, value, kind))
    assert str(caught.value) == f"terrain grid: {said}"


SOIL = 3  # column of the soil law in the table of materials, followed by its parameters
SINKING = [1.0, 1e6, 1.0, 0.5, 0.0, 0.6, 0.01, 1e6, 0.0, 0.0]  # a soil that is valid


def with_material(column: int, value: float, law: float = 0.0) -> bytes:
    """Returns a level grid of one material, whose table has another number in a column."""
    row = np.zeros(16)
    row[:3] = 0.5, NAN, NAN
    row[SOIL : SOIL + len(SINKING)] = SINKING
    row[SOIL] = law
    row[column] = value
    return grid_bytes(
        np.zeros((3, 4)),
        cell=0.1,
        kind=BLOCKS,
        material=np.ones((3, 4), np.uint8),
        table=row[None],
    )


@pytest.mark.parametrize(
    ("column", "value", "law", "said"),
    [
        (0, -0.1, 0.0, "mu: got -0.1, expected 0 to 100, or NaN"),
        (0, 101.0, 0.0, "mu: got 101, expected 0 to 100, or NaN"),
        (1, INFINITE, 0.0, "mu_static: got inf, expected 0 to 100, or NaN"),
        (1, -1.0, 0.0, "mu_static: got -1, expected 0 to 100, or NaN"),
        (2, 0.0, 0.0, "stiffness: got 0, expected 1e-3 to 1e14 N/m^1.5, or NaN"),
        (2, 1e15, 0.0, "stiffness: got 1e+15, expected 1e-3 to 1e14 N/m^1.5, or NaN"),
        (SOIL, 0.5, 0.5, "soil law: got 0.5, expected 0, 1, 2 or 3"),
        (SOIL, NAN, NAN, "soil law: got nan, expected 0, 1, 2 or 3"),
        (SOIL + 1, -1.0, 1.0, "number of a soil: got -1,"),
        (SOIL + 4, INFINITE, 2.0, "number of a soil: got inf,"),
        (SOIL + 3, 0.0, 1.0, "number of a soil: got 0,"),
        (SOIL + 6, 0.0, 3.0, "number of a soil: got 0,"),
        (SOIL + 7, 0.0, 2.0, "number of a soil: got 0,"),
        (SOIL + 9, NAN, 1.0, "number of a soil: got nan,"),
    ],
)
def test_a_number_of_a_material_out_of_its_range_is_named(
    core: ct.CDLL, column: int, value: float, law: float, said: str
) -> None:
    with pytest.raises(ValueError, match="terrain grid") as caught:
        Ground(core, with_material(column, value, law))
    assert str(caught.value).startswith(f"terrain grid: table: {said}")
