"""Shows a surface of the catalogue, and reads surfaces from options."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_table, show_text
from hexapod_cosim.cosim.common.files import named
from hexapod_cosim.cosim.scenario.tables import read_overrides
from hexapod_cosim.models import HexapodError, load_robot, unknown_name
from hexapod_cosim.models.ground.parameters import DIFFICULTY, Parameter
from hexapod_cosim.models.ground.surface import PLANES, Surface
from hexapod_cosim.models.ground.table import CATALOGUE, read_terrain

PICTURES = (".png", ".svg")
PREFIX = "terrain."


def show_terrain(surface: Surface, *, robot: str, picture: Path | None, as_json: bool) -> None:
    """Prints size and parameters of a surface, and draws it with a robot for scale.

    Raises HexapodError.
    """
    written = list[Path]()
    if picture is not None:
        # imported here: matplotlib is slow to import
        from hexapod_cosim.cosim.report.relief import draw_relief

        written.append(draw_relief(surface, load_robot(robot), _picture(picture)))
    facts = _facts(surface)
    if as_json:
        show_json({**facts, "written": [str(path) for path in written]})
        return
    for key, value in facts.items():
        show_text(f"{key}: {value}")
    entries = CATALOGUE[str(surface.recipe["kind"])].parameters.items()
    rows = [[key, _value(surface.recipe, key, one), one.about] for key, one in entries]
    show_table(["parameter", "value", "about"], rows)
    show_files(written)


def _value(recipe: Mapping[str, Any], key: str, parameter: Parameter) -> str:
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
    table: dict[str, Any] = {"kind": name}
    for key, value in read_overrides(values, where=name).items():
        table[key.removeprefix(PREFIX)] = value
    surface = read_terrain(table, "terrain").surface
    assert surface is not None  # each entry of the catalogue has one
    return surface


def surfaces_from(texts: Iterable[str]) -> list[Surface]:
    """Returns surfaces from texts NAME or NAME:KEY=VALUE,KEY=VALUE. Raises HexapodError."""
    found = []
    for text in texts:
        name, _, rest = text.partition(":")
        found.append(surface_from(name.strip(), [part for part in rest.split(",") if part]))
    return found


def _picture(path: Path) -> Path:
    """Returns the path of a picture. Raises HexapodError for a folder or another suffix."""
    if path.is_dir() or path.suffix not in PICTURES:
        raise HexapodError(
            "not a picture's name",
            got=str(path),
            expected="a file that ends in " + " or ".join(PICTURES),
            fix=f"write {named(path, PICTURES[0], 'ground')}",
        )
    return path
