"""Reads the table [terrain] of robot files and scenarios, and merges both."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from hexapod_cosim.models.errors import RobotError, refuse_path, unknown_name
from hexapod_cosim.models.ground.catalogue import CATALOGUE, make_surface
from hexapod_cosim.models.ground.patches import PATCH, read_patches
from hexapod_cosim.models.records import PLANES, Terrain
from hexapod_cosim.models.schema import (
    Choice,
    Spec,
    expect_table,
    refuse_unknown_keys,
    require,
    specs,
)

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
    kind = given.get("kind")
    if kind is not None:
        check_kind(kind, where)
    keys = list(terrain_specs()) if kind is None else keys_of(kind)
    refuse_unknown_keys(given, [*keys, "patch"], where)
    values: dict[str, Any] = {
        key: terrain_specs()[key].read(value, f"{where}.{key}")
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


def check_kind(kind: Any, where: str) -> None:
    """Raises RobotError for a kind that no file may give."""
    if kind not in NAMES:
        raise unknown_name("surface", str(kind), NAMES, where=f"{where}.kind", error=RobotError)


def keys_of(kind: str) -> list[str]:
    """Returns the keys of [terrain] for a kind, but for `patch`."""
    own = CATALOGUE[kind].parameters if kind in CATALOGUE else {}
    return ["kind", *PLACED, *own]


def read_terrain(table: Any, where: str) -> Terrain:
    """Returns the ground of a table [terrain]. Raises RobotError."""
    given = expect_table(table, where)
    if "kind" not in given:
        expected = f"one of {', '.join(NAMES)}"
        fix = "add `kind = ...`"
        raise RobotError("missing key", expected=expected, fix=fix, where=f"{where}.kind")
    kind = given["kind"]
    check_kind(kind, where)
    refuse_unknown_keys(given, [*keys_of(kind), "patch"], where)
    placed = {key: value for key, value in given.items() if key in PLACED}
    fields = {key: specs(Terrain)[key].read(placed[key], f"{where}.{key}") for key in placed}
    if kind in PLANES:
        if given.get("patch"):
            what = "patches on a ground without a map"
            expected = "a surface of the catalogue"
            fix = 'set terrain.kind = "plane", with slope_x for a slope'
            raise RobotError(what, got=kind, expected=expected, fix=fix, where=f"{where}.patch")
        return Terrain(**require(Terrain, fields | {"kind": kind}, where))
    rest = {key: value for key, value in given.items() if key not in ("kind", *PLACED)}
    surface = make_surface(kind, rest, where=where)
    return Terrain(**require(Terrain, fields | {"kind": "grid"}, where), surface=surface)


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


def beside(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Returns [terrain] with its `file` as an absolute path, relative to a folder until then."""
    file = table.get("file")
    if not isinstance(file, str) or not file:
        return dict(table)
    refuse_path(file, "the height map", RobotError)
    return {**table, "file": str((folder / file).resolve())}


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
