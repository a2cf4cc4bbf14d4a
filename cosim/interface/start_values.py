"""Start values of an FMU's parameters, without the rest of its interface.

A run sets them when it simulates a robot on the FMU of another one.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from types import SimpleNamespace
from typing import Any

from hexapod_cosim.cosim.common.components import Component
from hexapod_cosim.cosim.interface.patterns import expand, labelled
from hexapod_cosim.cosim.interface.plant import (
    Enumeration,
    Step,
    enumerations_of,
    read_table,
    start_path,
    value_at,
)

# name; a constant or None; without a constant the path from the roots to the value; enumeration
Row = tuple[str, Any, tuple[Step, ...], Enumeration | None]


def parameter_values(component: Component, roots: SimpleNamespace) -> dict[str, float]:
    """Returns the start values of parameters by name, as `expand_interface` does.

    Their ranges are not checked: the FMU does.
    """
    return {
        name: constant if constant is not None else value_at(roots, path, enumeration)
        for name, constant, path, enumeration in _rows(component)
    }


@cache
def _rows(component: Component) -> tuple[Row, ...]:
    """Returns the parameters of interface.toml, which is read once."""
    return tuple(_parameters(component))


def _parameters(component: Component) -> Iterator[Row]:
    """Yields the parameters of interface.toml that have a start value."""
    table, enumerations = read_table(component), enumerations_of(component)
    for entry in table.get("parameter", []):
        given = entry.get("start")
        for _, place in expand(entry, table["axis"]):
            name = labelled(entry["name"], {axis: label for axis, (_, label) in place.items()})
            enumeration = enumerations.get(entry.get("type", ""))
            if isinstance(given, str):
                yield name, None, start_path(given, place), enumeration
            elif given is not None:
                yield name, given, (), enumeration
