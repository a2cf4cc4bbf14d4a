"""Makes surfaces of the catalogue by name, and reads and merges tables [terrain].

Example: `make_surface("stairs", {"step_height": 0.02})`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from hexapod_cosim.models.errors import RobotError, refuse_path, unknown_name
from hexapod_cosim.models.ground.height_map import MAPS
from hexapod_cosim.models.ground.parameters import Entries, Entry, read_values, with_defaults
from hexapod_cosim.models.ground.patches import PATCH, read_patches, with_patches, with_soil
from hexapod_cosim.models.ground.rough import SMOOTH
from hexapod_cosim.models.ground.steps import BLOCKS
from hexapod_cosim.models.ground.surface import PLANES, Surface, Terrain
from hexapod_cosim.models.schema import (
    Choice,
    Spec,
    expect_table,
    missing_key,
    refuse_unknown_keys,
    specs,
)
from hexapod_cosim.models.soil.presets import soil_preset

MOST_NODES = 1 << 24  # of a generated surface
KEPT = 32  # surfaces in the cache
# in the order of lists
CATALOGUE: Entries = {**BLOCKS, **SMOOTH, **MAPS}


def entry_of(name: str, *, where: str | None = None) -> Entry:
    """Returns a surface of the catalogue. Raises RobotError for an unknown name."""
    if name not in CATALOGUE:
        raise unknown_name("surface", name, CATALOGUE, where=where, error=RobotError)
    return CATALOGUE[name]


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
    if "soil" in values:
        soil_preset(values["soil"], where=f"{where}.soil")  # refuses an unknown one
        surface = with_soil(surface, values["soil"])
    return with_patches(surface, [dict(patch) for patch in patches], where=f"{where}.patch")


def _check_size(values: Mapping[str, Any], where: str) -> None:
    """Raises RobotError for a map of too many or too few heights."""
    if "size" not in values or "horizontal_scale" not in values:
        return
    size, cell = values["size"], values["horizontal_scale"]
    if not (size / cell) ** 2 <= MOST_NODES or size < 2.0 * cell:
        what = "size and horizontal_scale of the map do not fit together"
        got = f"{size:g} m in cells of {cell:g} m"
        expected = f"2 to {round(MOST_NODES**0.5)} cells along an edge"
        fix = "change terrain.size or terrain.horizontal_scale"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where)


PLACED = ("height", "incline", "heading")  # keys of every kind
NAMES = (*PLANES, *CATALOGUE)


@cache
def terrain_specs() -> dict[str, Spec]:
    """Returns the keys of [terrain] for any kind, but for the list `patch`."""
    found: dict[str, Spec] = {"kind": Choice(NAMES)}
    found |= {key: specs(Terrain)[key] for key in PLACED}
    for entry in CATALOGUE.values():
        for key, parameter in entry.parameters.items():
            found.setdefault(key, parameter.spec)
    return found


def patch_specs() -> Mapping[str, Spec]:
    """Returns the keys of [[terrain.patch]]."""
    return PATCH


def read_keys(table: Any, where: str) -> dict[str, Any]:
    """Returns the values that a table gives, checked as far as possible without its kind.

    Raises RobotError.
    """
    given = expect_table(table, where)
    kind, known = given.get("kind"), terrain_specs()
    if kind is not None:
        if kind not in NAMES:
            raise unknown_name("surface", str(kind), NAMES, where=f"{where}.kind", error=RobotError)
        own = CATALOGUE[kind].parameters if kind in CATALOGUE else {}
        known = {key: known[key] for key in ("kind", *PLACED)}
        known |= {key: parameter.spec for key, parameter in own.items()}
    refuse_unknown_keys(given, [*known, "patch"], where)
    values: dict[str, Any] = {
        key: known[key].read(value, f"{where}.{key}")
        for key, value in given.items()
        if key != "patch"
    }
    if "patch" in given:
        values["patch"] = patch_lists(read_patches(given["patch"], f"{where}.patch"))
    return values


def patch_lists(patches: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Returns patches as files give them, with lists instead of tuples."""
    return [
        {key: list(value) if isinstance(value, tuple) else value for key, value in one.items()}
        for one in patches
    ]


def read_terrain(table: Any, where: str) -> Terrain:
    """Returns the ground of a table [terrain]. Raises RobotError."""
    values = read_keys(table, where)
    if "kind" not in values:
        raise missing_key("kind", terrain_specs()["kind"], f"{where}.kind")
    kind = values.pop("kind")
    placed = {key: values.pop(key) for key in PLACED if key in values}
    if kind not in PLANES:
        return Terrain(kind="grid", **placed, surface=make_surface(kind, values, where=where))
    if values.get("patch"):
        what = "patches on a ground without a map"
        expected = "a surface of the catalogue"
        fix = 'set terrain.kind = "plane", with slope_x for a slope'
        raise RobotError(what, got=kind, expected=expected, fix=fix, where=f"{where}.patch")
    return Terrain(kind=kind, **placed)


def merged_terrain(own: Terrain, given: Mapping[str, Any], where: str) -> Terrain:
    """Returns a ground with the values that a scenario gives.

    Parameters of the robot's own surface hold unless the scenario names another one. Raises
    RobotError.
    """
    if not given:
        return own
    recipe = dict(own.surface.recipe) if own.kind == "grid" and own.surface is not None else {}
    if own.kind == "grid" and not recipe and "kind" not in given:
        refuse_unknown_keys(given, list(PLACED), where)
        return replace(own, **dict(given))
    placed = {key: getattr(own, key) for key in PLACED}
    same = given.get("kind", own.name) == own.name
    kept = recipe if same else {}
    return read_terrain({"kind": own.name, **kept, **placed, **given}, where)


def terrain_beside(tables: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Returns a file's tables in which `file` of [terrain], relative to a folder until then, is an
    absolute path.
    """
    terrain = tables.get("terrain")
    file = terrain.get("file") if isinstance(terrain, Mapping) else None
    if terrain is None or not isinstance(file, str) or not file:
        return dict(tables)
    refuse_path(file, "the height map", RobotError)
    return {**tables, "terrain": {**terrain, "file": str((folder / file).resolve())}}


def terrain_table(terrain: Terrain) -> dict[str, Any]:
    """Returns the table [terrain] of a ground. Raises RobotError for a surface without recipe."""
    placed = {key: getattr(terrain, key) for key in PLACED}
    if terrain.kind in PLANES or terrain.surface is None:
        return {"kind": terrain.kind, **placed}
    if not terrain.surface.recipe:
        what = "a surface that no file can name"
        got = terrain.surface.name
        expected = "a surface of the catalogue"
        fix = "write its heights with numpy.save, and use kind = heightfield"
        raise RobotError(what, got=got, expected=expected, fix=fix, where="terrain")
    recipe = dict(terrain.surface.recipe)
    if "patch" in recipe:
        recipe["patch"] = patch_lists(recipe["patch"])
    return {**recipe, **placed}
