"""The surfaces by name, with their parameters: `make_surface("stairs", {"step_height": 0.02})`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.ground.catalogue_blocks import BLOCK_SURFACES
from hexapod_cosim.models.ground.catalogue_smooth import SMOOTH_SURFACES, SMOOTH_TILES
from hexapod_cosim.models.ground.curriculum import EQUAL, TileMaker, curriculum
from hexapod_cosim.models.ground.entries import Entry
from hexapod_cosim.models.ground.height_map import heightfield
from hexapod_cosim.models.ground.parameters import (
    HARD,
    PLATFORM,
    RANDOM_TILE,
    SIZE,
    Parameter,
    count,
    length,
    ratio,
    read_values,
    text,
    with_defaults,
)
from hexapod_cosim.models.ground.patches import check_soil, read_patches, with_patches, with_soil
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.schema import Number

MOST_NODES = 1 << 24  # of a generated surface
KEPT = 32  # surfaces in the cache
TILES = "pyramid_stairs inverted_pyramid_stairs discrete_obstacles stepping_stones"
TILE_NAMES = (*TILES.split(), "stairs", "steps", "step_up", "step_down", "gaps", "rubble")
SMOOTH_TILE_NAMES = ("pyramid_slope", "random_uniform", "wave", "ramp", "dune")
# names of legged_gym
TILE_ALIASES = {
    "smooth_slope": "pyramid_slope",
    "stairs_up": "inverted_pyramid_stairs",
    "stairs_down": "pyramid_stairs",
    "discrete": "discrete_obstacles",
}


def _curriculum(values: SimpleNamespace) -> Surface:
    made = [(name, CATALOGUE[name], False) for name in TILE_NAMES]
    made += [(name, CATALOGUE[name], True) for name in SMOOTH_TILE_NAMES]
    made += [(name, entry, True) for name, entry in SMOOTH_TILES.items()]
    makers = {name: TileMaker(entry.make, entry.parameters, flat) for name, entry, flat in made}
    return curriculum(values, makers | {new: makers[old] for new, old in TILE_ALIASES.items()})


MAPS: dict[str, Entry] = {
    "curriculum": Entry(
        "Tiles of rising difficulty along +x, terrains in columns",
        _curriculum,
        {
            **RANDOM_TILE,
            "size": replace(SIZE, about="edge of a tile"),
            "difficulty": replace(HARD, default=1.0, about="of the last row; the first has 0"),
            "num_rows": count(5, "tiles along x", most=1000),
            "num_cols": count(4, "tiles along y", most=1000),
            "border_width": length(1.0, "level ground around the tiles", zero=True),
            "terrains": text(TILES, "names of the columns' terrains"),
            "terrain_proportions": text(EQUAL, "columns' shares, one for each of terrains"),
        },
    ),
    "heightfield": Entry(
        "Height map from a file",
        heightfield,
        {
            "file": text(None, "path of a 16-bit PNG, a .npy array or an ESRI .asc grid"),
            "horizontal_scale": length(0.0, "per pixel or cell; 0: cellsize of the file",
                                       zero=True),
            "vertical_scale": length(0.0, "per unit of height; 0: the file is in metres",
                                     zero=True),
            "slope_threshold": ratio(
                0.0, "steeper maps become blocks; 0: always smooth", least=0.0, most=1e3
            ),
            "platform_size": replace(PLATFORM, default=0.0),
            "x": Parameter(spec=Number("m"), default=0.0, about="middle of the map"),
            "y": Parameter(spec=Number("m"), default=0.0, about="middle of the map"),
        },
    ),
}  # fmt: skip

# in the order of lists and of docs/ground.md
ORDER = (
    "plane",
    "stairs",
    "pyramid_stairs",
    "inverted_pyramid_stairs",
    "steps",
    "step_up",
    "step_down",
    "stepping_stones",
    "gaps",
    "wave",
    "random_uniform",
    "discrete_obstacles",
    "pyramid_slope",
    "ramp",
    "dune",
    "rubble",
    "sand",
    "course",
    "curriculum",
    "heightfield",
)
CATALOGUE: dict[str, Entry] = {
    name: (BLOCK_SURFACES | SMOOTH_SURFACES | MAPS)[name] for name in ORDER
}


def entry_of(name: str, *, where: str | None = None) -> Entry:
    """Returns a surface of the catalogue. Raises RobotError for an unknown name."""
    if name not in CATALOGUE:
        raise unknown_name("surface", name, CATALOGUE, where=where, error=RobotError)
    return CATALOGUE[name]


def parameter_of(key: str) -> Parameter | None:
    """Returns the parameter of this name of the first surface that has one."""
    found = (entry.parameters.get(key) for entry in CATALOGUE.values())
    return next((parameter for parameter in found if parameter is not None), None)


def make_surface(name: str, given: Mapping[str, Any], *, where: str = "terrain") -> Surface:
    """Returns a surface of the catalogue. Equal parameters give equal bits.

    Args:
        name: of the catalogue.
        given: its parameters that differ from their defaults, and `patch`, a list of tables.
        where: prefix of keys in messages.

    Raises RobotError.
    """
    entry = entry_of(name, where=f"{where}.kind")
    plain = {key: value for key, value in given.items() if key != "patch"}
    values = read_values(entry.parameters, plain, where)
    patches = read_patches(given.get("patch", ()), f"{where}.patch")
    recipe = {"kind": name, **values, **({"patch": patches} if patches else {})}
    stamp = _stamp(values)
    key = tuple(sorted(values.items())), tuple(tuple(sorted(one.items())) for one in patches)
    return replace(_made(name, *key, stamp, where), recipe=recipe)


def _stamp(values: Mapping[str, Any]) -> tuple[int, int]:
    """Returns time and size of a height map's file, so that a changed file is read again."""
    try:
        facts = Path(str(values["file"])).stat()
    except (KeyError, OSError):
        return 0, 0
    return facts.st_mtime_ns, facts.st_size


@lru_cache(maxsize=KEPT)
def _made(
    name: str,
    given: tuple[tuple[str, float | str], ...],
    patches: tuple[tuple[tuple[str, Any], ...], ...],
    _stamp: tuple[int, int],
    where: str,
) -> Surface:
    """Makes a surface from checked parameters."""
    entry = CATALOGUE[name]
    values = with_defaults(entry.parameters, dict(given), where)
    _check_size(values, where)
    surface = entry.make(SimpleNamespace(**values))
    _check_room(surface, values, where)
    if "soil" in values:
        check_soil(values["soil"], f"{where}.soil")
        surface = with_soil(surface, values["soil"])
    return with_patches(surface, [dict(patch) for patch in patches], where=f"{where}.patch")


def _check_size(values: Mapping[str, Any], where: str) -> None:
    """Raises RobotError for a map of too many or too few heights."""
    if "size" not in values or "horizontal_scale" not in values:
        return
    size, cell = values["size"], values["horizontal_scale"]
    if not (size / cell) ** 2 <= MOST_NODES or size < 2.0 * cell:
        raise RobotError(
            "size and horizontal_scale of the map do not fit together",
            got=f"{size:g} m in cells of {cell:g} m",
            expected=f"2 to {round(MOST_NODES**0.5)} cells along an edge",
            fix="change terrain.size or terrain.horizontal_scale",
            where=where,
        )


def _check_room(surface: Surface, values: Mapping[str, Any], where: str) -> None:
    """Raises RobotError where the map has no room beside the platform, or for all steps."""
    if "platform_size" not in values:
        return
    cell, platform = surface.cell, values["platform_size"]
    begin = cell * math.ceil(0.5 * platform / cell - 1e-9)
    if begin > surface.extent[1] - 0.5 * cell:
        raise RobotError(
            "the flat platform covers the whole map",
            got=f"size {values['size']:g} m, platform_size {platform:g} m",
            expected=f"a size of at least {2.0 * (begin + cell):.6g} m",
            fix="enlarge terrain.size, or reduce terrain.platform_size",
            where=where,
        )
    wanted = values.get("num_steps", 0)
    fit = round(float(surface.height.max()) / values["step_height"]) if wanted else 0
    if fit < wanted:
        size = math.ceil(20.0 * (begin + wanted * values["step_width"])) / 10.0
        raise RobotError(
            "more steps than the map has room for",
            got=f"num_steps {wanted} of {values['step_width']:g} m on a map of "
            f"{values['size']:g} m",
            expected=f"at most {fit} steps",
            fix=f"set terrain.size={size:g}, or fewer or narrower steps",
            where=where,
        )
