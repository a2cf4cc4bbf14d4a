"""Start values of an FMU's parameters without the rest of its interface: what a run sets that
walks a robot on another one's FMU.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from types import SimpleNamespace
from typing import Any

from hexapod_cosim.cosim.common.components import Component
from hexapod_cosim.cosim.interface.interface import Enumeration, enumerations_of, read_table
from hexapod_cosim.cosim.interface.patterns import expand, labelled

Step = str | int  # an attribute's name or a place in a sequence
Row = tuple[
    str, Any, tuple[Step, ...], Enumeration | None
]  # name, a constant or None, else the way from the roots to the value


def parameter_values(component: Component, roots: SimpleNamespace) -> dict[str, float]:
    """All parameters that start with something, by name, as `expand_interface` has them; their
    ranges are the FMU's to judge.
    """
    return {
        name: constant if constant is not None else _value(roots, way, choices)
        for name, constant, way, choices in _rows(component)
    }


def _value(roots: SimpleNamespace, way: tuple[Step, ...], choices: Enumeration | None) -> float:
    value: Any = roots
    for step in way:
        value = getattr(value, step) if isinstance(step, str) else value[step]
    if isinstance(value, bool):
        return value
    return choices.number(value) if choices else float(value)


@cache
def _rows(component: Component) -> tuple[Row, ...]:
    """interface.toml's parameters, read once."""
    return tuple(_parameters(component))


def _parameters(component: Component) -> Iterator[Row]:
    table, enumerations = read_table(component), enumerations_of(component)
    for entry in table.get("parameter", []):
        given = entry.get("start")
        for _, place in expand(entry, table["axis"]):
            name = labelled(entry["name"], {axis: label for axis, (_, label) in place.items()})
            choices = enumerations.get(entry.get("type", ""))
            if isinstance(given, str):
                yield name, None, tuple(_way(given, place)), choices
            elif given is not None:
                yield name, given, (), choices


def _way(given: str, place: Any) -> Iterator[Step]:
    for attribute, axis in re.findall(r"(?:^|\.)(\w+)|\[(\w+)\]", given):
        yield attribute or (place[axis][0] if axis in place else int(axis))
