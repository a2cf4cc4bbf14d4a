"""The FMU's variables, from a component's interface.toml and one robot.

This is the only list of names, value references and start values: model descriptions, C tables and
documentation are generated from it.
"""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from types import SimpleNamespace
from typing import Any, Literal

from hexapod_cosim.cosim.common.components import PLANT, Component
from hexapod_cosim.cosim.common.plant_files import interface_file, package_version
from hexapod_cosim.cosim.interface.patterns import (
    expand,
    expand_names,
    labelled,
    own_axes,
    with_defaults,
)
from hexapod_cosim.models.errors import HexapodError, unknown_name
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.statics import settled

Causality = Literal["input", "output", "parameter", "local"]
Type = Literal["Real", "Boolean", "Enumeration", "Integer"]

Step = str | int  # of a path to a start value: an attribute's name or an index of a sequence

CAUSALITIES: tuple[Causality, ...] = ("input", "output", "parameter", "local")
DEFAULT_VARIABILITY = {
    "input": "continuous",
    "output": "continuous",
    "parameter": "fixed",
    "local": "continuous",
}
# of the settled pose [m, rad]: rounds off differences between machines
POSE_DECIMALS = 10


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit and its display unit.

    exponents: of the SI base units; None where they are no integers, as FMI requires.
    display: name of the display unit and factor: display value = factor * value.
    type: the type that variables of this unit declare.
    """

    name: str
    exponents: Mapping[str, int] | None
    display: tuple[str, float] | None
    type: str | None = None


@dataclass(frozen=True, kw_only=True)
class Enumeration:
    """An enumeration type.

    Item k of `items` (name, description) has the number k + 1 and the C constant {prefix}_{NAME}.
    """

    name: str
    prefix: str
    items: tuple[tuple[str, str], ...]

    def number(self, item: str) -> int:
        """Returns the number of an item. Raises HexapodError for an unknown one."""
        names = [name for name, _ in self.items]
        if item not in names:
            raise unknown_name(self.name, item, names)
        return names.index(item) + 1

    def constant(self, number: int) -> str:
        """Returns the C constant of a number."""
        return f"{self.prefix}_{self.items[number - 1][0]}".upper()


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One scalar variable of the FMU.

    depends: states and inputs that an output or local variable is a direct function of; None: all.
    initial: parameters that its initial value depends on, besides those of its states; None: all.
    group: of the outputs that are computed together; None: all.
    """

    name: str
    reference: int
    type: Type
    causality: Causality
    variability: str
    unit: str | None  # of a Real
    minimum: float | None
    maximum: float | None
    nominal: float | None
    start: float | int | None  # None for outputs
    enumeration: str | None
    field: str  # lvalue in struct hxVariables
    depends: tuple[str, ...] | None
    initial: tuple[str, ...] | None
    group: str | None
    description: str


@dataclass(frozen=True, kw_only=True)
class State:
    """A continuous state of model exchange, its derivative and the parameters that its initial
    value depends on, by the names of their variables.
    """

    name: str
    derivative: str
    initial: tuple[str, ...]
    reinit: bool  # whether an event may set it


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """One entry of interface.toml, which stands for one variable or for several.

    axes: the axes in the name, each with its labels; in the order of the variables the first axis
    runs slowest.
    """

    name: str
    axes: tuple[tuple[str, tuple[str, ...]], ...]
    causality: Causality
    kind: str  # unit or type
    description: str


@dataclass(frozen=True, kw_only=True)
class Interface:
    """The content of one FMU's model description."""

    component: Component
    robot: Robot
    version: str
    variables: tuple[Variable, ...]
    states: tuple[State, ...]  # in the order in which importers exchange them
    event_indicators: int
    indicator_patterns: tuple[str, ...]  # those whose variables are the event indicators
    patterns: tuple[Pattern, ...]
    units: tuple[Unit, ...]
    enumerations: Mapping[str, Enumeration]
    log_categories: Mapping[str, str]
    first_reference: Mapping[str, int]
    stop_time: float  # s
    step: float  # s
    directional_derivatives: bool = True  # of components with states: the binary has them

    @cached_property
    def by_name(self) -> Mapping[str, Variable]:
        """The variables by name."""
        return {variable.name: variable for variable in self.variables}

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Indices of variables in the model description, from 1, by name."""
        return {variable.name: place for place, variable in enumerate(self.variables, start=1)}

    @cached_property
    def derivative_of(self) -> Mapping[str, int]:
        """Indices of states by the names of their derivatives."""
        return {state.derivative: self.index[state.name] for state in self.states}

    @cached_property
    def reinitialised(self) -> frozenset[str]:
        """Names of the states that an event may set."""
        return frozenset(state.name for state in self.states if state.reinit)

    def depends(self, name: str) -> tuple[str, ...] | None:
        """Returns the states and inputs that an output or derivative is a direct function of.

        None: all.
        """
        return self.variable(name).depends

    def depends_initially(self, name: str) -> tuple[str, ...] | None:
        """Returns the parameters and inputs that an initial value depends on; None: all."""
        variable, start = self.variable(name), {state.name: state.initial for state in self.states}
        if name in start:
            return start[name]
        if variable.depends is None or variable.initial is None:
            return None
        through = [known for state in variable.depends for known in start.get(state, (state,))]
        return tuple(dict.fromkeys([*through, *variable.initial]))

    def variable(self, name: str) -> Variable:
        """Returns a variable by name. Raises HexapodError, which suggests the nearest name."""
        if name not in self.by_name:
            raise unknown_name("FMU variable", name, self.by_name)
        return self.by_name[name]

    def references(self, names: Iterable[str]) -> list[int]:
        """Returns value references in the order of the names. Raises HexapodError."""
        return [self.variable(name).reference for name in names]

    def of_causality(self, *causalities: Causality) -> list[Variable]:
        """Returns the variables of these causalities in the order of their references."""
        return [variable for variable in self.variables if variable.causality in causalities]


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
    enumerations = enumerations_of(component)
    variables = tuple(_expand_all(table, enumerations, roots))
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
        enumerations=enumerations,
        log_categories=table["log_category"],
        first_reference=table["first_reference"],
        stop_time=table["experiment"]["stop"],
        step=table["experiment"]["step"],
    )


@cache
def read_table(component: Component) -> dict[str, Any]:
    """Reads a component's interface.toml. The result is shared and must not be changed."""
    table = tomllib.loads(interface_file(component).read_text(encoding="utf-8"))
    for causality in CAUSALITIES:
        entries = table.get(causality, [])
        if any("record" in entry for entry in entries):
            from hexapod_cosim.cosim.interface.gain_rows import (  # noqa: PLC0415  slow to import
                rows_of_records,
            )

            entries = rows_of_records(entries)
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


def _expand_all(
    table: Mapping[str, Any], enumerations: Mapping[str, Enumeration], roots: SimpleNamespace
) -> Iterable[Variable]:
    """Yields all variables by causality, in the order of interface.toml."""
    for causality in CAUSALITIES:
        places = itertools.chain.from_iterable(
            expand(entry, table["axis"]) for entry in table.get(causality, [])
        )
        for reference, (entry, place) in enumerate(
            places, start=table["first_reference"][causality]
        ):
            yield _variable(entry, place, reference, causality, enumerations, roots, table)


def _variable(
    entry: Mapping[str, Any],
    place: Mapping[str, tuple[int, str]],
    reference: int,
    causality: Causality,
    enumerations: Mapping[str, Enumeration],
    roots: SimpleNamespace,
    table: Mapping[str, Any],
) -> Variable:
    """Returns the variable of an entry at one combination of its axes."""
    labels = {axis: label for axis, (_, label) in place.items()}
    enumeration = enumerations.get(entry.get("type", ""))
    kind: Type = "Enumeration" if enumeration else entry.get("type", "Real")
    variable = Variable(
        name=labelled(entry["name"], labels),
        reference=reference,
        type=kind,
        causality=causality,
        variability=entry.get(
            "variability",
            DEFAULT_VARIABILITY[causality]
            if kind == "Real" or causality == "parameter"
            else "discrete",
        ),
        unit=entry.get("unit"),
        minimum=1 if enumeration else entry.get("min"),
        maximum=len(enumeration.items) if enumeration else entry.get("max"),
        nominal=entry.get("nominal"),
        start=_start(entry.get("start"), place, enumeration, roots),
        enumeration=enumeration.name if enumeration else None,
        field=re.sub(r"\[(\w+)\]", lambda match: f"[{place[match[1]][0]}]", entry["field"]),
        description=entry["description"].format(**labels),
        depends=expand_names(entry.get("depends"), labels, table),
        initial=expand_names(entry.get("initial"), labels, table),
        group=entry.get("group"),
    )
    _check_start(variable)
    return variable


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


def _start(
    given: float | str | None,
    place: Mapping[str, tuple[int, str]],
    enumeration: Enumeration | None,
    roots: SimpleNamespace,
) -> float | int | None:
    """Returns a start value: a constant, or the value at a path such as robot.torso.mass."""
    if not isinstance(given, str):
        return given
    return value_at(roots, start_path(given, place), enumeration)


def start_path(given: str, place: Mapping[str, tuple[int, str]]) -> tuple[Step, ...]:
    """Returns the steps of a path such as robot.legs[leg].hip_yaw at a combination of axes."""
    return tuple(
        attribute or (place[axis][0] if axis in place else int(axis))
        for attribute, axis in re.findall(r"(?:^|\.)(\w+)|\[(\w+)\]", given)
    )


def value_at(
    roots: SimpleNamespace, path: Iterable[Step], enumeration: Enumeration | None
) -> float | int:
    """Returns the value at a path from the roots; of an enumeration, the number of the item."""
    value: Any = roots
    for step in path:
        value = getattr(value, step) if isinstance(step, str) else value[step]
    if isinstance(value, bool):
        return value
    return enumeration.number(value) if enumeration else float(value)


def _check_start(variable: Variable) -> None:
    """Raises HexapodError for a start value out of range, for which importers refuse the FMU."""
    low = -math.inf if variable.minimum is None else variable.minimum
    high = math.inf if variable.maximum is None else variable.maximum
    if variable.start is not None and not (
        low <= variable.start <= high and math.isfinite(variable.start)
    ):
        raise HexapodError(
            "start value out of range",
            got=variable.start,
            expected=f"{low:g} to {high:g} {variable.unit or ''}".rstrip(),
            fix="correct the robot",
            where=variable.name,
        )
