"""Checks the grid files in an FMU's resources, which the plant reads as surfaces of the ground."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

import numpy as np

from hexapod_cosim.cosim.validate.start_value import START_VALUES
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.grid_file import surface_from_bytes
from hexapod_cosim.models.ground.surface import LAW, MU, MU_STATIC, STIFFNESS, Array
from hexapod_cosim.models.records import SOIL_LAWS, TERRAINS

FOLDER = "resources/terrain/"
NUMBERED = re.compile(re.escape(FOLDER) + r"([1-9][0-9]*)\.terrain")
GRID = 1 + TERRAINS.index("grid")  # start value of terrain.kind
# of a material: column, name, least value; NaN: as the definition has it
NUMBERS = ((MU, "mu", 0.0), (MU_STATIC, "mu_static", 0.0), (STIFFNESS, "stiffness", 1e-3))


def grid_problems(found: Mapping[str, bytes]) -> Iterator[str]:
    """Yields damaged and misnamed grid files, gaps in their numbers, and a missing start grid.

    found: the archive's files by path.
    """
    numbers = set()
    for name in sorted(name for name in found if name.startswith(FOLDER)):
        match = NUMBERED.fullmatch(name)
        if match is None:
            yield f"{name} is no name of a grid file; expected {FOLDER}1.terrain, 2.terrain, ..."
            continue
        numbers.add(int(match[1]))
        yield from _content_problems(name, found[name])
    for number in sorted(set(range(1, max(numbers, default=0))) - numbers):
        yield f"{FOLDER}{number}.terrain is missing: grids are numbered from 1 without a gap"
    yield from _start_problems(found.get(START_VALUES, b""), numbers)


def _content_problems(name: str, content: bytes) -> Iterator[str]:
    """Yields the problem of one grid file."""
    try:
        surface = surface_from_bytes(content, where=name)
    except RobotError as error:
        yield str(error) if error.where == name else f"{name}: {error}"
        return
    if surface.materials is not None:
        for row, material in enumerate(surface.materials, start=1):
            yield from _material_problems(f"{name}: material {row}", material)


def _material_problems(where: str, material: Array) -> Iterator[str]:
    """Yields the invalid numbers of a material."""
    for column, name, least in NUMBERS:
        value = float(material[column])
        if not math.isnan(value) and not least <= value < math.inf:
            yield f"{where}: {name} is {value!r}, expected at least {least:g}, or NaN for none"
    law = float(material[LAW])
    if law not in range(len(SOIL_LAWS)):
        yield f"{where}: soil law is {law!r}, expected 0 to {len(SOIL_LAWS) - 1}"
    elif law and not bool(np.all(np.isfinite(material[LAW:]) & (material[LAW:] >= 0.0))):
        yield f"{where}: a number of its soil is negative or no number"


def _start_problems(start_values: bytes, numbers: set[int]) -> Iterator[str]:
    """Yields a grid that the FMU starts on and that is not in the archive."""
    words = (line.split() for line in start_values.decode("utf-8", errors="replace").split("\n"))
    stated = {line[2]: line[1] for line in words if len(line) == 3}
    kind, grid = (_number(stated.get(f"terrain.{key}", "nan")) for key in ("kind", "grid"))
    if kind == GRID and grid not in numbers:
        present = ", ".join(map(str, sorted(numbers))) or "none"
        yield (
            f"{START_VALUES}: the FMU starts on grid {grid:g}, but {FOLDER}{grid:.0f}.terrain is "
            f"missing; grids in the archive: {present}"
        )


def _number(word: str) -> float:
    """Parses a number; NaN for other text."""
    try:
        return float.fromhex(word)
    except ValueError:
        return math.nan
