"""Defines the command `hexapod list`."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.controller import PATTERNS
from hexapod_cosim.cosim.cli.extension import Rows, list_functions
from hexapod_cosim.cosim.cli.terminal import Json, show_json, show_table, show_text
from hexapod_cosim.cosim.cli.terrain_command import value_text
from hexapod_cosim.cosim.interface.plant_interface import load_interface
from hexapod_cosim.cosim.scenario.tables import list_scenarios
from hexapod_cosim.models import LEG_NAMES, Terrain, list_robots, load_robot, unknown_name
from hexapod_cosim.models.ground.catalogue import CATALOGUE
from hexapod_cosim.models.ground.parameters import DIFFICULTY, Entry
from hexapod_cosim.models.ground.table import PLACED
from hexapod_cosim.models.records import PLANES
from hexapod_cosim.models.schema import Number, specs
from hexapod_cosim.models.servos.motor import no_load_speed, stall_torque
from hexapod_cosim.models.servos.presets import list_servos, measured_servo
from hexapod_cosim.models.soil.presets import list_soils, soil_preset


def robots() -> Rows:
    """Returns the bundled robots; mass in kg."""
    loaded = [load_robot(name) for name in list_robots()]
    return [
        {
            "name": robot.name,
            "mass": round(robot.total_mass, 6),
            "about": robot.source.get("robot", ""),
        }
        for robot in loaded
    ]


def scenarios() -> Rows:
    """Returns the bundled scenarios."""
    return titles(list_scenarios())


def titles(files: Mapping[str, Path]) -> Rows:
    """Returns the titles of TOML files, by name."""
    return [
        {
            "name": name,
            "about": str(tomllib.loads(path.read_text(encoding="utf-8")).get("title", "")),
        }
        for name, path in files.items()
    ]


def gaits() -> Rows:
    """Returns the gaits with their natural duty factor and the phase of each leg."""
    return [
        {"name": name, "duty": gait.duty, **dict(zip(LEG_NAMES, gait.offsets, strict=True))}
        for name, gait in PATTERNS.items()
    ]


def terrains() -> Rows:
    """Returns the kinds of ground with the defaults of their parameters."""
    planes = [row for row in _choices("TerrainKind") if row["name"] in PLANES]
    for row in planes:
        keys = PLACED if row["name"] == "slope" else PLACED[:1]
        row["about"] += ": " + ", ".join(f"{key} 0 {_unit(key)}" for key in keys)
    return [*planes, *(_surface(name, entry) for name, entry in CATALOGUE.items())]


def _unit(key: str) -> str:
    """Returns the unit of a key of planes."""
    spec = specs(Terrain)[key]
    return spec.unit if isinstance(spec, Number) else ""


def _surface(name: str, entry: Entry) -> dict[str, Any]:
    """Returns the row of a surface of the catalogue."""
    texts = [
        f"{key} {value_text(one, one.value(DIFFICULTY))}" for key, one in entry.parameters.items()
    ]
    return {"name": name, "about": f"{entry.about}: {', '.join(texts)}"}


def soils() -> Rows:
    """Returns the bundled soils with their law and the source of their numbers."""
    presets = {name: soil_preset(name) for name in list_soils()}
    return [
        {"name": name, "law": preset.soil.law, "about": preset.title, "source": preset.source}
        for name, preset in presets.items()
    ]


def servos() -> Rows:
    """Returns the measured servos: friction model, voltage [V], stall torque [N m], no-load speed
    [rad/s], and the source of their numbers.
    """
    found = {name: measured_servo(name) for name in list_servos()}
    return [
        {
            "name": name,
            "friction": one.about.friction_model,
            "voltage": one.servo.voltage,
            "stall": stall_torque(one.servo),
            "no load": no_load_speed(one.servo),
            "about": one.about.title,
            "source": one.about.source,
        }
        for name, one in found.items()
    ]


def laws() -> Rows:
    """Returns the laws of the normal and the tangential contact force, and of soil."""
    kinds = {"ContactLaw": "contact.law", "FrictionLaw": "friction.law", "SoilLaw": "soil.law"}
    return [{"key": key} | row for kind, key in kinds.items() for row in _choices(kind)]


def _choices(enumeration: str) -> Rows:
    interface = load_interface(load_robot(list_robots()[0]))
    return [
        {"name": name, "about": text} for name, text in interface.enumerations[enumeration].items
    ]


LISTS: dict[str, Callable[[], Rows]] = {
    "robots": robots,
    "scenarios": scenarios,
    "gaits": gaits,
    "terrains": terrains,
    "soils": soils,
    "servos": servos,
    "laws": laws,
    **list_functions(),
}


What = Annotated[
    str,
    typer.Argument(
        metavar="|".join(LISTS),
        help="What to list.",
        autocompletion=lambda incomplete: [name for name in LISTS if name.startswith(incomplete)],
    ),
]


def list_what(what: What, json: Json = False) -> None:
    """List robots, scenarios, gaits, terrains, soils, servos, laws or what an extension adds."""
    if what not in LISTS:
        raise unknown_name("list", what, LISTS)
    rows = LISTS[what]()
    if json:
        show_json(rows)
        return
    shown = [{key: value for key, value in row.items() if key != "source"} for row in rows]
    show_table(list(shown[0]), [[_text(value) for value in row.values()] for row in shown])
    if shown != rows:
        show_text(f"`hexapod list {what} --json` has the sources of the numbers")


def _text(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"
