"""Defines `hexapod list` and `hexapod terrain`, which show what there is."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.extension import Rows, list_functions, loaded
from hexapod_cosim.cosim.cli.options import Json, RobotName


def robots() -> Rows:
    """Returns the bundled robots; mass in kg."""
    from hexapod_cosim.models import list_robots, load_robot

    found = [load_robot(name) for name in list_robots()]
    return [
        {
            "name": robot.name,
            "mass": round(robot.total_mass, 6),
            "about": robot.source.get("robot", ""),
        }
        for robot in found
    ]


def scenarios() -> Rows:
    """Returns the bundled scenarios."""
    from hexapod_cosim.cosim.scenario import list_scenarios

    return titles(list_scenarios())


def titles(files: Mapping[str, Path]) -> Rows:
    """Returns the titles of TOML files, by name."""
    tables = {name: tomllib.loads(path.read_text(encoding="utf-8")) for name, path in files.items()}
    return [{"name": name, "about": str(one.get("title", ""))} for name, one in tables.items()]


def gaits() -> Rows:
    """Returns the gaits with their natural duty factor and the phase of each leg."""
    from hexapod_cosim.controller import PATTERNS
    from hexapod_cosim.models import LEG_NAMES

    return [
        {"name": name, "duty": gait.duty, **dict(zip(LEG_NAMES, gait.offsets, strict=True))}
        for name, gait in PATTERNS.items()
    ]


def terrains() -> Rows:
    """Returns the kinds of ground with the defaults of their parameters."""
    from hexapod_cosim.models.ground.parameters import DIFFICULTY
    from hexapod_cosim.models.ground.surface import PLANES
    from hexapod_cosim.models.ground.table import CATALOGUE, PLACED

    units = {"height": "m", "incline": "rad", "heading": "rad"}
    rows = [row for row in _choices("TerrainKind") if row["name"] in PLANES]
    for row in rows:
        keys = PLACED if row["name"] == "slope" else PLACED[:1]
        row["about"] += ": " + ", ".join(f"{key} 0 {units[key]}" for key in keys)
    for name, entry in CATALOGUE.items():
        texts = [
            f"{key} {one.text(one.value(DIFFICULTY))}" for key, one in entry.parameters.items()
        ]
        rows.append({"name": name, "about": f"{entry.about}: {', '.join(texts)}"})
    return rows


def soils() -> Rows:
    """Returns the bundled soils with their law and the source of their numbers."""
    from hexapod_cosim.models.soil.presets import list_soils, soil_preset

    presets = {name: soil_preset(name) for name in list_soils()}
    return [
        {"name": name, "law": preset.soil.law, "about": preset.title, "source": preset.source}
        for name, preset in presets.items()
    ]


def servos() -> Rows:
    """Returns the measured servos: friction model, voltage [V], torque at stall within the
    firmware's current [N m], no-load speed [rad/s], and the source of their numbers.
    """
    from hexapod_cosim.models.servos.motor import no_load_speed
    from hexapod_cosim.models.servos.presets import list_servos, measured_servo

    found = {name: measured_servo(name) for name in list_servos()}
    return [
        {
            "name": name,
            "friction": one.about.friction_model,
            "voltage": one.servo.voltage,
            "stall": one.servo.torque_limit,
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
    """Returns the items of an enumeration of the plant's FMU."""
    from hexapod_cosim.cosim.common.components import PLANT
    from hexapod_cosim.cosim.interface.plant import enumerations_of

    items = enumerations_of(PLANT)[enumeration].items
    return [{"name": name, "about": text} for name, text in items]


OWN: dict[str, Callable[[], Rows]] = {
    "robots": robots,
    "scenarios": scenarios,
    "gaits": gaits,
    "terrains": terrains,
    "soils": soils,
    "servos": servos,
    "laws": laws,
}
NAMES = (*OWN, *list_functions())
What = Annotated[
    str,
    typer.Argument(
        metavar="|".join(NAMES),
        help="What to list.",
        autocompletion=lambda incomplete: [name for name in NAMES if name.startswith(incomplete)],
    ),
]


def list_what(what: What, json: Json = False) -> None:
    """List robots, scenarios, gaits, terrains, soils, servos, laws or what an extension adds."""
    from hexapod_cosim.cosim.cli.terminal import show_json, show_table, show_text

    if what not in NAMES:
        from hexapod_cosim.models.errors import unknown_name

        raise unknown_name("list", what, NAMES)
    rows = OWN[what]() if what in OWN else loaded(list_functions()[what])()
    if json:
        show_json(rows)
        return
    shown = [{key: value for key, value in row.items() if key != "source"} for row in rows]
    show_table(list(shown[0]), [[_text(value) for value in row.values()] for row in shown])
    if shown != rows:
        show_text(f"`hexapod list {what} --json` has the sources of the numbers")


def _text(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def terrain(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A surface of `hexapod list terrains`.",
            autocompletion=completion.surface,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Draw the surface as PNG or SVG."),
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Set a parameter of the surface: step_height=30mm."
        ),
    ] = None,
    robot: RobotName = "athena",
    json: Json = False,
) -> None:
    """Show a surface: its size and parameters, and its picture beside a robot."""
    from hexapod_cosim.cosim.cli.terrains import show_terrain, surface_from

    show_terrain(surface_from(name, values or []), robot=robot, picture=output, as_json=json)
