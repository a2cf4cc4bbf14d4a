"""Shows a kind of ground, and reads surfaces from options."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_table, show_text
from hexapod_cosim.cosim.common.files import named
from hexapod_cosim.cosim.report.relief import draw_relief, write_heights
from hexapod_cosim.cosim.scenario.sections import read_terrain_keys
from hexapod_cosim.cosim.scenario.tables import parse_value
from hexapod_cosim.models import HexapodError, Terrain, load_robot, unknown_name
from hexapod_cosim.models.ground.parameters import DIFFICULTY, Parameter
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.table import CATALOGUE, NAMES, PLACED, read_terrain
from hexapod_cosim.models.records import PLANES

PICTURES = (".png", ".svg")
PREFIX = "terrain."
SHOWN_EDGE, SHOWN_CELL = 4.0, 0.05  # m    of the part of a plane that is drawn


def show_terrain(
    ground: Terrain, *, robot: str, picture: Path | None, heights: Path | None, as_json: bool
) -> None:
    """Prints size and parameters of a kind of ground; draws it and writes its heights.

    robot: drawn for scale. Raises HexapodError.
    """
    surface = ground.surface or _part_of_plane(ground)
    written, keys = list[Path](), dict[str, float]()
    if picture is not None:
        written.append(draw_relief(surface, load_robot(robot), _with_suffix(picture, PICTURES)))
    if heights is not None:
        keys = write_heights(surface, _with_suffix(heights, (".png",)))
        written.append(heights)
    facts = _facts(surface) if ground.surface else _facts_of_plane(ground)
    if as_json:
        read = {"heights": {"file": str(heights), **keys}} if heights is not None else {}
        show_json({**facts, "written": [str(path) for path in written], **read})
        return
    for key, value in facts.items():
        show_text(f"{key}: {value}")
    if ground.surface:
        entries = CATALOGUE[str(surface.recipe["kind"])].parameters.items()
        rows = [[key, _value(surface.recipe, key, one), one.about] for key, one in entries]
        show_table(["parameter", "value", "about"], rows)
    show_files(written)
    if keys:
        listed = ", ".join(f"{key} = {value!r}" for key, value in keys.items())
        show_text(f'to read the heights: kind = "heightfield", file = "{heights}", {listed}')


def _value(recipe: Any, key: str, parameter: Parameter) -> str:
    """Returns a parameter's value with its unit."""
    difficulty = float(recipe.get("difficulty", DIFFICULTY))
    return parameter.text(recipe.get(key, parameter.value(difficulty)))


def _facts(surface: Surface) -> dict[str, Any]:
    """Returns what a surface is, for people and for JSON."""
    return {
        "name": surface.name,
        "kind": surface.kind,
        "rows": surface.rows,
        "columns": surface.columns,
        "cell [m]": round(surface.cell, 9),
        "x, y [m]": [round(edge, 6) for edge in surface.extent],
        "heights [m]": [
            round(float(height), 9) for height in (surface.height.min(), surface.height.max())
        ],
        "materials": 0 if surface.materials is None else len(surface.materials),
        "sha256": surface.digest,
    }


def _facts_of_plane(ground: Terrain) -> dict[str, Any]:
    """Returns what a plane is: it has no edges, and is in every FMU."""
    placed = PLACED if ground.kind == "slope" else PLACED[:1]
    units = {"height": "m", "incline": "rad", "heading": "rad"}
    found: dict[str, Any] = {"name": ground.name, "kind": "plane without edges"}
    return found | {f"{key} [{units[key]}]": getattr(ground, key) for key in placed}


def _part_of_plane(ground: Terrain) -> Surface:
    """Returns the part of a plane around the origin, above its height there, as a grid."""
    line = np.linspace(-0.5 * SHOWN_EDGE, 0.5 * SHOWN_EDGE, round(SHOWN_EDGE / SHOWN_CELL) + 1)
    x, y = np.meshgrid(line, line)
    rise = x * math.cos(ground.heading) + y * math.sin(ground.heading)
    height = math.tan(ground.incline) * rise
    return Surface(
        kind="smooth", height=height, x0=line[0], y0=line[0], cell=SHOWN_CELL, name=ground.name
    )


def surface_from(name: str, values: Iterable[str]) -> Surface:
    """Returns a surface by its name and texts KEY=VALUE. Raises HexapodError."""
    if name in PLANES:
        raise HexapodError(
            "a plane is no surface",
            got=name,
            expected=f"one of {', '.join(CATALOGUE)}",
            fix=f"leave it out: every FMU has planes, which terrain.kind = {name} chooses",
        )
    if name not in CATALOGUE:
        raise unknown_name("surface", name, CATALOGUE)
    surface = ground_from(name, values).surface
    assert surface is not None  # each entry of the catalogue has one
    return surface


def ground_from(name: str, values: Iterable[str]) -> Terrain:
    """Returns a kind of ground by its name and texts KEY=VALUE. Raises HexapodError."""
    if name not in NAMES:
        raise unknown_name("terrain", name, NAMES)
    table: dict[str, Any] = {"kind": name}
    for text in values:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not equals or not key or not value:
            raise HexapodError(
                "not a setting",
                got=text,
                expected="KEY=VALUE",
                fix="write step_height=0.03",
                where=name,
            )
        table[key.removeprefix(PREFIX)] = parse_value(value)
    ground = read_terrain(read_terrain_keys(table, "terrain"), "terrain")
    if ground.kind == "flat" and (ground.incline or ground.heading):
        raise HexapodError(
            "level ground with a slope",
            got=", ".join(f"{key} = {getattr(ground, key):g}" for key in PLACED[1:]),
            expected="height alone",
            fix="show `slope` instead",
            where=name,
        )
    return ground


def surfaces_from(texts: Iterable[str]) -> list[Surface]:
    """Returns surfaces from texts NAME or NAME:KEY=VALUE,KEY=VALUE. Raises HexapodError."""
    found = []
    for text in texts:
        name, _, rest = text.partition(":")
        found.append(surface_from(name.strip(), [part for part in rest.split(",") if part]))
    return found


def _with_suffix(path: Path, suffixes: tuple[str, ...]) -> Path:
    """Returns the path. Raises HexapodError for a folder or another suffix."""
    if path.is_dir() or path.suffix not in suffixes:
        raise HexapodError(
            "not a picture's name",
            got=str(path),
            expected="a file that ends in " + " or ".join(suffixes),
            fix=f"write {named(path, suffixes[0], 'ground')}",
        )
    return path
