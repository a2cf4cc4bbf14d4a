"""Units and descriptions of a recording's columns, read from the interface.toml of plant and
controller.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from hexapod_cosim.cosim.common.components import CONTROLLER, PLANT, Component
from hexapod_cosim.cosim.interface.patterns import expand, labelled
from hexapod_cosim.cosim.interface.plant import read_table

NO_UNIT = "1"
HEADING = re.compile(r"(?P<name>.*\S) \[(?P<unit>[^\[\]]*)\]")  # no space precedes an index


@dataclass(frozen=True)
class Column:
    """Unit and description of a variable."""

    unit: str
    description: str


@cache
def known_columns() -> Mapping[str, Column]:
    """Returns all columns that a run can record, by name.

    They are time, the plant's outputs and inputs, `controller.*` and `command.*`.
    """
    controller = {
        f"controller.{name}": column for name, column in _variables(CONTROLLER, "output").items()
    }
    commands = {
        name: column
        for name, column in _variables(CONTROLLER, "input").items()
        if name.startswith("command.")
    }
    return (
        {"time": Column("s", "Time")}
        | plant_variables("output")
        | plant_variables("input")
        | controller
        | commands
    )


def plant_variables(causality: str) -> dict[str, Column]:
    """Returns the variables of a plant FMU of one causality, in model description order."""
    return _variables(PLANT, causality)


def _variables(component: Component, causality: str) -> dict[str, Column]:
    table, found = read_table(component), {}
    for pattern in table[causality]:
        for entry, place in expand(pattern, table["axis"]):
            labels = {axis: label for axis, (_, label) in place.items()}
            found[labelled(entry["name"], labels)] = Column(
                entry.get("unit", NO_UNIT), entry["description"].format(**labels)
            )
    return found


def heading(name: str) -> str:
    """Returns a column's name and unit, as "torso.position[1] [m]"; only the name if unknown."""
    column = known_columns().get(name)
    return f"{name} [{column.unit}]" if column else name


def wrong_unit(text: str) -> str | None:
    """Returns the unit that a heading should have if its own is another one; None if it is right,
    missing, or that of an unknown column.
    """
    found = HEADING.fullmatch(text)
    column = known_columns().get(found["name"]) if found else None
    if found is None or column is None or _plain(found["unit"]) == _plain(column.unit):
        return None
    return column.unit


def _plain(unit: str) -> str:
    """Returns a unit without differences of spelling: N m, Nm and N.m; m/s^2, m/s² and m/s2."""
    plain = unit.strip().replace("²", "2").replace("^", "")
    return "" if plain in ("-", NO_UNIT) else re.sub(r"[ .·*]", "", plain)


def bare_name(text: str) -> str:
    """Returns the name in a heading with or without a unit."""
    found = HEADING.fullmatch(text)
    return found["name"] if found else text
