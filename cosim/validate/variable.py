"""Checks the variables of a model description: the rules that FMI 2.0 and 3.0 share."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

INTERFACES = ("ModelExchange", "CoSimulation")
NUMBERS = ("Real", "Int", "UInt", "Float")  # beginnings of the types that have min, max, nominal
DEPENDENCY_KINDS = {"dependent", "constant", "fixed", "tunable", "discrete"}


@dataclass(frozen=True)
class Entry:
    """A variable or a declared type."""

    name: str
    kind: str  # Real, Float64, Enumeration, ...
    attributes: Mapping[str, str]  # unit, declaredType, min, start, ...
    description: str = ""
    items: tuple[str, ...] = ()  # values of a declared enumeration

    @property
    def starts(self) -> list[str]:
        """The start values of all elements."""
        return self.attributes.get("start", "").split()


def declaration_problems(
    root: Element, variables: Sequence[Entry], types: Sequence[Entry]
) -> Iterator[str]:
    """Yields the problems of variables, types, units and default experiment.

    The model description must be one that its schema accepts.
    """
    by_name = {entry.name: entry for entry in types}
    yield from _identity_problems(root, variables)
    yield from _unit_problems(root, [*variables, *types], by_name)
    for variable in variables:
        yield from _variable_problems(variable, by_name)
    yield from _experiment_problems(root)


def _identity_problems(root: Element, variables: Sequence[Entry]) -> Iterator[str]:
    """Yields invalid identifiers and duplicate names."""
    found = [root.find(name) for name in INTERFACES]
    identifiers = {element.get("modelIdentifier", "") for element in found if element is not None}
    for name in identifiers:
        if not (name.isascii() and name.isidentifier()):
            yield f"modelIdentifier is {name!r}, expected a C identifier"
    token = "guid" if "guid" in root.attrib else "instantiationToken"
    if not root.get(token):
        yield f"the {token} is empty, expected one that the binary knows"
    for name, count in Counter(variable.name for variable in variables).items():
        if count > 1:
            yield f"{name} stands for {count} variables, expected one"


def _unit_problems(
    root: Element, users: Sequence[Entry], types: Mapping[str, Entry]
) -> Iterator[str]:
    """Yields units, display units and types that are unknown or unused."""
    displays = {
        unit.get("name"): {entry.get("name") for entry in unit.iterfind("DisplayUnit")}
        for unit in root.iterfind(".//Unit")
    }
    for user in users:
        unit, display = user.attributes.get("unit"), user.attributes.get("displayUnit")
        if unit is not None and unit not in displays:
            yield f"{user.name}: unit {unit!r} is not defined"
        if display is not None and display not in displays.get(unit, ()):
            yield f"{user.name}: display unit {display!r} is not defined for {unit!r}"
        yield from _type_problems(user, types)
    for unit in sorted(map(str, set(displays) - {user.attributes.get("unit") for user in users})):
        yield f"unit {unit!r} is defined, but no variable has it"


def _type_problems(user: Entry, types: Mapping[str, Entry]) -> Iterator[str]:
    """Yields problems of a variable's declared type."""
    declared = user.attributes.get("declaredType")
    if declared is None:
        return
    base = types.get(declared)
    if base is None or base.kind != user.kind:
        yield (
            f"{user.name}: declared type {declared!r} is "
            f"{'not defined' if base is None else f'no {user.kind}'}"
        )
        return
    unit, expected = user.attributes.get("unit"), base.attributes.get("unit")
    if unit is not None and unit != expected:
        yield f"{user.name}: unit {unit!r} is not that of its type {declared!r}, {expected!r}"


def _variable_problems(variable: Entry, types: Mapping[str, Entry]) -> Iterator[str]:
    """Yields the problems of one variable."""
    base = types.get(variable.attributes.get("declaredType", ""))
    if not variable.description:
        yield f"{variable.name} has no description"
    if base is not None and base.kind != variable.kind:
        base = None
    if variable.kind == "Enumeration" and base is not None:
        for start in sorted(set(variable.starts) - set(base.items)):
            yield f"{variable.name}: start {start} is no item of its type"
    if variable.kind.startswith(NUMBERS):
        yield from _number_problems(variable, {} if base is None else base.attributes)


def _number_problems(variable: Entry, inherited: Mapping[str, str]) -> Iterator[str]:
    """Yields invalid numbers. Attributes of the variable precede those of its type."""
    words = {**inherited, **variable.attributes}
    given = {key: float(words[key]) for key in ("min", "max", "nominal") if key in words}
    starts = [float(word) for word in words.get("start", "").split()]
    for key, value in (*given.items(), *(("start", start) for start in starts)):
        if not math.isfinite(value):
            yield f"{variable.name}: {key} is {value}, expected a finite number"
    low, high = given.get("min", -math.inf), given.get("max", math.inf)
    if low > high:
        yield f"{variable.name}: min {low} is above max {high}"
    outside = [start for start in starts if not low <= start <= high]
    if outside:
        yield f"{variable.name}: start {outside[0]} is not within min {low} and max {high}"
    if given.get("nominal", 1.0) == 0.0:
        yield f"{variable.name}: nominal is 0, expected another number"


def dependency_problems(where: str, unknown: Element, known: Collection[int]) -> Iterator[str]:
    """Yields invalid dependencies of an entry of ModelStructure.

    Dependencies must be among the known indices or value references.
    """
    dependencies = [int(word) for word in unknown.get("dependencies", "").split()]
    if any(dependency not in known for dependency in dependencies):
        yield f"{where}: a dependency is not one of the {len(known)} variables"
    if dependencies != sorted(set(dependencies)):
        yield f"{where}: dependencies are not ascending, each once"
    kinds = unknown.get("dependenciesKind")
    if kinds is not None and (
        len(kinds.split()) != len(dependencies) or not set(kinds.split()) <= DEPENDENCY_KINDS
    ):
        yield (
            f"{where}: dependenciesKind does not tell one kind for each of {len(dependencies)} "
            "dependencies"
        )


def _experiment_problems(root: Element) -> Iterator[str]:
    """Yields an invalid default experiment."""
    experiment = root.find("DefaultExperiment")
    if experiment is None:
        return
    start, stop, step = (
        float(experiment.get(key, default))
        for key, default in (("startTime", "0"), ("stopTime", "1"), ("stepSize", "1"))
    )
    if not (start < stop and 0.0 < step <= stop - start):
        yield f"DefaultExperiment: steps of {step} s from {start} s to {stop} s make no experiment"
