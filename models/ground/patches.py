"""Puts materials on a surface: squares of other friction, stiffness or soil."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.surface import (
    LAW,
    MATERIAL_COLUMNS,
    MOST_MATERIALS,
    MU,
    MU_STATIC,
    STIFFNESS,
    Bytes,
    Surface,
)
from hexapod_cosim.models.schema import (
    Number,
    Spec,
    Text,
    Vector,
    expect_table,
    refuse_unknown_keys,
)
from hexapod_cosim.models.soil.law import table_row
from hexapod_cosim.models.soil.presets import soil_preset

WIDTH = Number("m", above=0.0)
# keys of [[terrain.patch]]
PATCH: dict[str, Spec] = {
    "x": Number("m"),  # middle of the patch
    "y": Number("m"),
    "size": WIDTH,  # edge; or a list: along x, along y
    "mu": Number("1", at_least=0.0, at_most=10.0),
    "mu_static": Number("1", at_least=0.0, at_most=10.0),
    "stiffness": Number("N/m^1.5", above=0.0),
    "soil": Text(),
}
PROPERTIES = {"mu": MU, "mu_static": MU_STATIC, "stiffness": STIFFNESS}


def read_patches(value: Any, where: str) -> tuple[dict[str, Any], ...]:
    """Returns the checked [[terrain.patch]] entries. Raises RobotError."""
    if not isinstance(value, list | tuple):
        expected = "entries [[terrain.patch]]"
        fix = "write [[terrain.patch]] with two brackets"
        raise RobotError("wrong type", got=value, expected=expected, fix=fix, where=where)
    patches = tuple(_read_patch(item, f"{where}[{k}]") for k, item in enumerate(value))
    if len(patches) > MOST_MATERIALS:
        raise RobotError(
            "too many patches", got=len(patches), expected=f"at most {MOST_MATERIALS}", where=where
        )
    return patches


def _read_patch(value: Any, where: str) -> dict[str, Any]:
    """Returns one checked patch; its size as two lengths."""
    table = expect_table(value, where)
    refuse_unknown_keys(table, list(PATCH), where)
    found: dict[str, Any] = {}
    for key, given in table.items():
        spec = PATCH[key]
        if key == "size" and isinstance(given, list | tuple):
            spec = Vector("m", 2, above=0.0)
        found[key] = spec.read(given, f"{where}.{key}")
    if "size" in found and not isinstance(found["size"], tuple):
        found["size"] = (found["size"], found["size"])
    for key in ("x", "y", "size"):
        if key not in found:
            raise RobotError(
                "missing key", expected="a value in m", fix=f"add `{key} = ...`", where=where
            )
    if not {*PROPERTIES, "soil"} & set(found):
        what = "a patch like its surroundings"
        expected = "one of mu, mu_static, stiffness, soil"
        fix = "say in what the patch differs"
        raise RobotError(what, got=sorted(found), expected=expected, fix=fix, where=where)
    if "soil" in found:
        soil_preset(found["soil"], where=f"{where}.soil")  # refuses an unknown one
    return found


def material_row(patch: Mapping[str, Any]) -> Array:
    """Returns the material (16,) of a patch; NaN where the definition's value holds."""
    row = np.zeros(MATERIAL_COLUMNS)
    row[:LAW] = math.nan
    for key, column in PROPERTIES.items():
        if key in patch:
            row[column] = patch[key]
    if "soil" in patch:
        row[LAW:] = table_row(soil_preset(patch["soil"]).soil)
    return row


def with_soil(surface: Surface, soil: str) -> Surface:
    """Returns the surface with one soil everywhere."""
    material = np.ones(surface.height.shape, dtype=np.uint8)
    table = material_row({"soil": soil})[None, :]
    return replace(surface, material=material, materials=table)


def with_patches(surface: Surface, patches: Sequence[Mapping[str, Any]], *, where: str) -> Surface:
    """Returns the surface with patches, of which later ones lie on earlier ones.

    Raises RobotError for a patch that is not on the map.
    """
    if not patches:
        return surface
    material = (
        np.zeros(surface.height.shape, dtype=np.uint8)
        if surface.material is None
        else surface.material.copy()
    )
    table = [] if surface.materials is None else list(surface.materials)
    for k, patch in enumerate(patches):
        table.append(material_row(patch))
        _lay(material, surface, patch, len(table), f"{where}[{k}]")
    return replace(surface, material=material, materials=np.array(table))


def _lay(
    material: Bytes, surface: Surface, patch: Mapping[str, Any], number: int, where: str
) -> None:
    """Sets the material of the nodes or blocks within a patch, in place."""
    left, right, low, high = surface.extent
    half = [0.5 * size for size in patch["size"]]
    place = patch["x"], patch["y"]
    if not (
        left <= place[0] - half[0]
        and place[0] + half[0] <= right
        and low <= place[1] - half[1]
        and place[1] + half[1] <= high
    ):
        raise RobotError(
            "a patch that leaves the map",
            got=f"x {place[0] - half[0]:.4g} to {place[0] + half[0]:.4g}, "
            f"y {place[1] - half[1]:.4g} to {place[1] + half[1]:.4g} m",
            expected=f"x {left:.4g} to {right:.4g}, y {low:.4g} to {high:.4g} m",
            fix="move it, or enlarge the map with terrain.size",
            where=where,
        )
    shift = 0.0 if surface.kind == "smooth" else 0.5
    x = surface.x0 + surface.cell * (np.arange(surface.columns) + shift)
    y = surface.y0 + surface.cell * (np.arange(surface.rows) + shift)
    columns, rows = np.abs(x - place[0]) <= half[0], np.abs(y - place[1]) <= half[1]
    if not (columns.any() and rows.any()):
        what = "a patch smaller than the map's cells"
        expected = f"at least {surface.cell:.4g} m"
        fix = "enlarge it, or reduce terrain.horizontal_scale"
        raise RobotError(what, got=list(patch["size"]), expected=expected, fix=fix, where=where)
    material[np.ix_(rows, columns)] = number
