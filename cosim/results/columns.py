"""Units and meanings of a recording's columns, from where its variables are defined:
interface.toml of the plant and of the controller.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from hexapod_cosim.cosim.common.components import CONTROLLER, PLANT, Component
from hexapod_cosim.cosim.interface.interface import read_table
from hexapod_cosim.cosim.interface.patterns import expand, labelled

NO_UNIT = "1"
HEADING = re.compile(
    r"(?P<name>.*\S) \[(?P<unit>[^\[\]]*)\]"
)  # an index follows its name without a space


@dataclass(frozen=True)
class Column:
    """What a variable is measured in, and what it is."""

    unit: str
    description: str


@cache
def known_columns() -> Mapping[str, Column]:
    """Everything that a run records, by name: time, the plant's outputs and inputs,
    `controller.*` and `command.*`.
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
    """The variables of any plant's FMU of one causality, by name, in the order of its model
    description.
    """
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
    """A column's name with its unit behind it, "torso.position[1] [m]"; the bare name of what we
    do not know.
    """
    column = known_columns().get(name)
    return f"{name} [{column.unit}]" if column else name


def bare_name(text: str) -> str:
    """The name in a heading, whether there is a unit behind it or not."""
    found = HEADING.fullmatch(text)
    return found["name"] if found else text
