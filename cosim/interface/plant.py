"""The FMU's variables, from a component's interface.toml and one robot.

This is the only list of names, value references and start values: model descriptions, C tables and
documentation are generated from it.
"""

from __future__ import annotations

import itertools
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from types import SimpleNamespace
from typing import Any

from hexapod_cosim.controller.signals import DEFAULT_PERIOD
from hexapod_cosim.cosim.common.components import PLANT, Component
from hexapod_cosim.cosim.common.plant_files import interface_file, package_version
from hexapod_cosim.cosim.interface.patterns import (
    expand,
    expand_names,
    labelled,
    own_axes,
    with_defaults,
)
from hexapod_cosim.cosim.interface.records import (
    CAUSALITIES,
    Causality,
    Enumeration,
    Interface,
    Pattern,
    State,
    Type,
    Unit,
    Variable,
)
from hexapod_cosim.models.errors import HexapodError
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.statics import settled

Step = str | int  # of a path to a start value: an attribute's name or an index of a sequence

DEFAULT_VARIABILITY = {
    "input": "continuous",
    "output": "continuous",
    "parameter": "fixed",
    "local": "continuous",
}
# of the settled pose [m, rad]: rounds off differences between machines
POSE_DECIMALS = 10


@lru_cache(maxsize=16)
def load_interface(robot: Robot) -> Interface:
    """Returns the interface of a robot's plant FMU.

    Raises HexapodError when a value of the robot is out of its variable's range.
    """
    return expand_interface(PLANT, robot, plant_roots(robot))


def expand_interface(component: Component, robot: Robot, roots: SimpleNamespace) -> Interface:
    """Returns a component's interface, with start values from the attributes of `roots`.

    Raises HexapodError when one is out of its variable's range.
    """
    table = read_table(component)
    variables = tuple(
        replace(one.variable, start=one.start(roots)) if one.path else one.variable
        for one in _templates(component)
    )
    for variable in variables:
        if variable.start is not None:  # importers refuse others
            variable.check(variable.start, HexapodError, name=variable.name)
    return Interface(
        component=component,
        robot=robot,
        version=package_version(),
        variables=variables,
        states=tuple(_states(table)),
        event_indicators=table["event"]["indicators"] if "event" in table else 0,
        indicator_patterns=tuple(table["event"]["shown_by"]) if "event" in table else (),
        patterns=tuple(
            _pattern(entry, causality, table["axis"])
            for causality in CAUSALITIES
            for entry in table.get(causality, [])
        ),
        units=tuple(_unit(name, entry) for name, entry in table["unit"].items()),
        enumerations=enumerations_of(component),
        log_categories=table["log_category"],
        first_reference=table["first_reference"],
        stop_time=table["experiment"]["stop"],
        step=table["experiment"].get("step", DEFAULT_PERIOD),
    )


def parameter_values(component: Component, roots: SimpleNamespace) -> dict[str, float]:
    """Returns the start values of parameters by name, as `expand_interface` does.

    Their ranges are not checked: the FMU does.
    """
    values = {
        one.variable.name: one.start(roots)
        for one in _templates(component)
        if one.variable.causality == "parameter"
    }
    return {name: value for name, value in values.items() if value is not None}


@cache
def read_table(component: Component) -> dict[str, Any]:
    """Reads a component's interface.toml. The result is shared and must not be changed."""
    table = tomllib.loads(interface_file(component).read_text(encoding="utf-8"))
    for causality in CAUSALITIES:
        entries = table.get(causality, [])
        if any("record" in entry for entry in entries):
            # imported only here because it is slow to import
            from hexapod_cosim.cosim.interface import gain_rows  # noqa: PLC0415

            entries = gain_rows.rows_of_records(entries)
        table[causality] = [with_defaults(entry, causality, table["unit"]) for entry in entries]
    return table


@cache
def enumerations_of(component: Component) -> Mapping[str, Enumeration]:
    """Returns a component's enumeration types by name."""
    return {
        name: _enumeration(name, entry)
        for name, entry in read_table(component)["enumeration"].items()
    }


def plant_roots(robot: Robot) -> SimpleNamespace:
    """Returns the objects that start values in the plant's interface.toml refer to."""
    return SimpleNamespace(robot=robot, settled=_settled_pose(robot))


def _settled_pose(robot: Robot) -> SimpleNamespace:
    """Returns position, quaternion and angles of the robot at rest on the ground, rounded."""
    position, quaternion, angle = settled(robot)
    return SimpleNamespace(
        position=_rounded(position),
        quaternion=_rounded(quaternion),
        angle=[_rounded(leg) for leg in angle],
    )


def _rounded(values: Iterable[float]) -> list[float]:
    """Rounds numbers to POSE_DECIMALS."""
    return [round(float(value), POSE_DECIMALS) + 0.0 for value in values]


def _enumeration(name: str, entry: Mapping[str, str]) -> Enumeration:
    """Returns the enumeration type of an entry of interface.toml."""
    items = tuple((item, text) for item, text in entry.items() if item != "prefix")
    return Enumeration(name=name, prefix=entry["prefix"], items=items)


def _unit(name: str, entry: Any) -> Unit:
    """Returns the unit of an entry of interface.toml."""
    if isinstance(entry, str):
        return Unit(name=name, exponents=None, display=None)
    display = (
        (entry["display"]["name"], float(entry["display"]["factor"]))
        if "display" in entry
        else None
    )
    exponents = {
        key: value for key, value in entry.items() if key not in ("display", "type", "nominal")
    }
    return Unit(name=name, exponents=exponents, display=display, type=entry.get("type"))


def _pattern(
    entry: Mapping[str, Any], causality: Causality, axes: Mapping[str, list[str]]
) -> Pattern:
    """Returns the pattern of an entry of interface.toml."""
    own = tuple((axis, tuple(labels)) for axis, labels in own_axes(entry, axes).items())
    kind = entry.get("unit", entry.get("type", ""))
    return Pattern(
        name=entry["name"],
        axes=own,
        causality=causality,
        kind=kind,
        description=entry["description"],
    )


@dataclass(frozen=True)
class Template:
    """A variable without its robot.

    path: from the roots to its start value; () where it is constant or absent.
    """

    variable: Variable
    path: tuple[Step, ...]
    enumeration: Enumeration | None

    def start(self, roots: SimpleNamespace) -> float | int | None:
        """Returns the start value; of an enumeration, the number of the item."""
        if not self.path:
            return self.variable.start
        value: Any = roots
        for step in self.path:
            value = getattr(value, step) if isinstance(step, str) else value[step]
        if isinstance(value, bool):
            return value
        return self.enumeration.number(value) if self.enumeration else float(value)


@cache
def _templates(component: Component) -> tuple[Template, ...]:
    """Returns all variables by causality, in the order of interface.toml."""
    table = read_table(component)
    found: list[Template] = []
    for causality in CAUSALITIES:
        places = itertools.chain.from_iterable(
            expand(entry, table["axis"]) for entry in table.get(causality, [])
        )
        found += [
            _template(component, entry, place, reference, causality)
            for reference, (entry, place) in enumerate(places, table["first_reference"][causality])
        ]
    return tuple(found)


def _template(
    component: Component,
    entry: Mapping[str, Any],
    place: Mapping[str, tuple[int, str]],
    reference: int,
    causality: Causality,
) -> Template:
    """Returns the variable of an entry at one combination of its axes."""
    table = read_table(component)
    labels = {axis: label for axis, (_, label) in place.items()}
    enumeration = enumerations_of(component).get(entry.get("type", ""))
    kind: Type = "Enumeration" if enumeration else entry.get("type", "Real")
    start, changes = entry.get("start"), kind == "Real" or causality == "parameter"
    variable = Variable(
        name=labelled(entry["name"], labels),
        reference=reference,
        type=kind,
        causality=causality,
        variability=entry.get(
            "variability", DEFAULT_VARIABILITY[causality] if changes else "discrete"
        ),
        unit=entry.get("unit"),
        minimum=1 if enumeration else entry.get("min"),
        maximum=len(enumeration.items) if enumeration else entry.get("max"),
        nominal=entry.get("nominal"),
        start=None if isinstance(start, str) else start,
        enumeration=enumeration.name if enumeration else None,
        field=re.sub(r"\[(\w+)\]", lambda match: f"[{place[match[1]][0]}]", entry["field"]),
        description=entry["description"].format(**labels),
        depends=expand_names(entry.get("depends"), labels, table),
        initial=expand_names(entry.get("initial"), labels, table),
        group=entry.get("group"),
    )
    return Template(variable, _path(start, place), enumeration)


def _path(start: Any, place: Mapping[str, tuple[int, str]]) -> tuple[Step, ...]:
    """Returns the steps of a path such as robot.legs[leg].hip_yaw at a combination of axes."""
    return tuple(
        attribute or (place[axis][0] if axis in place else int(axis))
        for attribute, axis in re.findall(
            r"(?:^|\.)(\w+)|\[(\w+)\]", start if isinstance(start, str) else ""
        )
    )


def _states(table: Mapping[str, Any]) -> Iterable[State]:
    """Yields the continuous states."""
    for entry in table.get("state", []):
        for _, place in expand(entry, table["axis"]):
            labels = {axis: label for axis, (_, label) in place.items()}
            name, derivative = (labelled(entry[key], labels) for key in ("name", "derivative"))
            yield State(
                name=name,
                derivative=derivative,
                initial=expand_names(entry["initial"], labels, table) or (),
                reinit=entry.get("reinit", False),
            )
