"""Is a modelDescription.xml of FMI 2.0 what the standard means? What its schema and fmpy's validation do not see."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

import fmpy
from lxml import etree

SCHEMAS = Path(fmpy.__file__).parent / "schema"
INTERFACES = ("ModelExchange", "CoSimulation")
KINDS = {"Real", "Integer", "Boolean", "String", "Enumeration"}
DEPENDENCY_KINDS = {"dependent", "constant", "fixed", "tunable", "discrete"}


def schema_problems(member: str, data: bytes, schema: str) -> list[str]:
    """Where a document breaks one of the standard's schemas, such as fmi3/fmi3TerminalsAndIcons.xsd."""
    try:
        document = etree.fromstring(data)
    except etree.XMLSyntaxError as error:
        return [f"{member} is no XML: {error}"]
    rules = etree.XMLSchema(etree.parse(str(SCHEMAS / schema)))
    rules.validate(document)
    return [f"{member} line {error.line}: {error.message}" for error in rules.error_log]


def description_problems(root: Element) -> list[str]:
    """Everything below, of a document that its schema accepts."""
    checks = (_identity_problems, _unit_problems, _variable_problems, _structure_problems, _experiment_problems)
    return [problem for check in checks for problem in check(root)]


def variables(root: Element) -> list[tuple[Element, Element]]:
    """Each ScalarVariable with the element of its type."""
    return [(variable, kind) for variable in root.iterfind("ModelVariables/ScalarVariable") for kind in variable if kind.tag in KINDS]


def _identity_problems(root: Element) -> Iterator[str]:
    found = [root.find(name) for name in INTERFACES]
    identifiers = {element.get("modelIdentifier", "") for element in found if element is not None}
    for name in identifiers:
        if not (name.isascii() and name.isidentifier()):
            yield f"modelIdentifier is {name!r}, expected a C identifier"
    if not root.get("guid"):
        yield "the guid is empty, expected one that the binary knows"
    for name, count in Counter(str(variable.get("name")) for variable, _ in variables(root)).items():
        if count > 1:
            yield f"{name} stands for {count} variables, expected one"


def _unit_problems(root: Element) -> Iterator[str]:
    """Units defined and used, display units and types known."""
    displays = {unit.get("name"): {entry.get("name") for entry in unit.iterfind("DisplayUnit")} for unit in root.iterfind(".//Unit")}
    types = {entry.get("name", ""): entry for entry in root.iterfind("TypeDefinitions/SimpleType")}
    users = [(str(variable.get("name")), kind) for variable, kind in variables(root)]
    users += [(name, kind) for name, entry in types.items() for kind in entry]
    for name, kind in users:
        unit, display = kind.get("unit"), kind.get("displayUnit")
        if unit is not None and unit not in displays:
            yield f"{name}: unit {unit!r} is not defined"
        if display is not None and display not in displays.get(unit, ()):
            yield f"{name}: display unit {display!r} is not defined for {unit!r}"
        yield from _type_problems(name, kind, types)
    for unit in sorted(map(str, set(displays) - {kind.get("unit") for _, kind in users})):
        yield f"unit {unit!r} is defined, but no variable has it"


def _type_problems(name: str, kind: Element, types: Mapping[str, Element]) -> Iterator[str]:
    declared = kind.get("declaredType")
    if declared is None:
        return
    entry = types.get(declared)
    base = None if entry is None else entry.find(kind.tag)
    if base is None:
        yield f"{name}: declared type {declared!r} is {'not defined' if entry is None else f'no {kind.tag}'}"
    elif kind.get("unit", base.get("unit")) != base.get("unit"):
        yield f"{name}: unit {kind.get('unit')!r} is not that of its type {declared!r}, {base.get('unit')!r}"


def _variable_problems(root: Element) -> Iterator[str]:
    types = {entry.get("name", ""): entry for entry in root.iterfind("TypeDefinitions/SimpleType")}
    for variable, kind in variables(root):
        name = str(variable.get("name"))
        declared = types.get(kind.get("declaredType", ""))
        base = None if declared is None else declared.find(kind.tag)
        if not variable.get("description"):
            yield f"{name} has no description"
        if kind.tag == "Enumeration" and base is not None:
            yield from _enumeration_problems(name, kind, base)
        if kind.tag in ("Real", "Integer"):
            yield from _number_problems(name, kind, {} if base is None else dict(base.attrib))


def _enumeration_problems(name: str, kind: Element, base: Element) -> Iterator[str]:
    values = {item.get("value") for item in base.iterfind("Item")}
    if kind.get("start") is not None and kind.get("start") not in values:
        yield f"{name}: start {kind.get('start')} is no item of its type"


def _number_problems(name: str, kind: Element, inherited: dict[str, str]) -> Iterator[str]:
    """Attributes of the variable itself stand before its type's."""
    given = {key: float(value) for key, value in (inherited | dict(kind.attrib)).items() if key in ("min", "max", "nominal", "start")}
    for key, value in given.items():
        if not math.isfinite(value):
            yield f"{name}: {key} is {value}, expected a finite number"
    low, high = given.get("min", -math.inf), given.get("max", math.inf)
    if low > high:
        yield f"{name}: min {low} is above max {high}"
    if not low <= given.get("start", low) <= high:
        yield f"{name}: start {given['start']} is not within min {low} and max {high}"
    if given.get("nominal", 1.0) == 0.0:
        yield f"{name}: nominal is 0, expected another number"


def _structure_problems(root: Element) -> Iterator[str]:
    """Indices of ModelStructure, from 1, and what they may refer to."""
    ordered = list(root.iterfind("ModelVariables/ScalarVariable"))
    for section in root.iterfind("ModelStructure/*"):
        indices = [int(unknown.get("index", "0")) for unknown in section]
        if indices != sorted(set(indices)) and section.tag != "Derivatives":
            yield f"ModelStructure/{section.tag}: indices are not ascending, each once"
        for unknown in section:
            yield from _unknown_problems(section.tag, unknown, ordered)
    count = len(root.findall("ModelStructure/Derivatives/Unknown"))
    states = len([kind for _, kind in variables(root) if kind.get("derivative") is not None])
    if count != states:
        yield f"ModelStructure/Derivatives has {count} entries, but {states} variables are derivatives"


def _unknown_problems(section: str, unknown: Element, ordered: list[Element]) -> Iterator[str]:
    where = f"ModelStructure/{section} index {unknown.get('index')}"
    if not 1 <= int(unknown.get("index", "0")) <= len(ordered):
        yield f"{where}: no such variable, there are {len(ordered)}"
        return
    variable = ordered[int(unknown.get("index", "0")) - 1]
    if section == "Outputs" and variable.get("causality") != "output":
        yield f"{where}: {variable.get('name')} is no output"
    dependencies = _integers(unknown.get("dependencies", ""))
    if any(not 1 <= index <= len(ordered) for index in dependencies):
        yield f"{where}: a dependency is not one of the {len(ordered)} variables"
    if dependencies != sorted(set(dependencies)):
        yield f"{where}: dependencies are not ascending, each once"
    kinds = unknown.get("dependenciesKind")
    if kinds is not None and (len(kinds.split()) != len(dependencies) or not set(kinds.split()) <= DEPENDENCY_KINDS):
        yield f"{where}: dependenciesKind does not tell one kind for each of {len(dependencies)} dependencies"


def _integers(words: str) -> list[int]:
    return [int(word) for word in words.split()]


def _experiment_problems(root: Element) -> Iterable[str]:
    experiment = root.find("DefaultExperiment")
    if experiment is None:
        return []
    start, stop, step = (float(experiment.get(key, default)) for key, default in (("startTime", "0"), ("stopTime", "1"), ("stepSize", "1")))
    good = start < stop and 0.0 < step <= stop - start
    return [] if good else [f"DefaultExperiment: steps of {step} s from {start} s to {stop} s make no experiment"]
