"""Checks modelDescription.xml of FMI 3.0 for errors that its schema and fmpy do not find."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element

from hexapod_cosim.cosim.validate.variable import Entry, declaration_problems, dependency_problems

SECTIONS = (
    "Output",
    "ContinuousStateDerivative",
    "ClockedState",
    "InitialUnknown",
    "EventIndicator",
)
DERIVATIVES = "ContinuousStateDerivative"  # in the order of the states; others are ascending


def description_problems3(root: Element) -> list[str]:
    """Returns the problems of a document that its schema accepts, one sentence each."""
    types = [
        Entry(
            entry.get("name", ""), entry.tag.removesuffix("Type"), entry.attrib, items=_items(entry)
        )
        for entry in root.iterfind("TypeDefinitions/*")
    ]
    return [
        *declaration_problems(root, variables3(root), types),
        *_size_problems(root),
        *_structure_problems(root),
    ]


def variables3(root: Element) -> list[Entry]:
    """Returns each variable; an array is one variable."""
    found = root.iterfind("ModelVariables/*")
    return [
        Entry(entry.get("name", ""), entry.tag, entry.attrib, entry.get("description", ""))
        for entry in found
    ]


def _items(entry: Element) -> tuple[str, ...]:
    """Returns the values of an enumeration type."""
    return tuple(item.get("value", "") for item in entry.iterfind("Item"))


def _size_problems(root: Element) -> Iterator[str]:
    """Yields variables whose number of start values is neither 1 nor that of the elements."""
    for variable in root.iterfind("ModelVariables/*"):
        size = math.prod(
            int(dimension.get("start", "1")) for dimension in variable.iterfind("Dimension")
        )
        count = len(variable.get("start", "").split())
        if variable.get("start") is not None and count not in (1, size):
            yield f"{variable.get('name')}: {count} start values, expected {size}"


def _structure_problems(root: Element) -> Iterator[str]:
    """Yields invalid value references in ModelStructure."""
    known = {
        int(variable.get("valueReference", "-1")): variable
        for variable in root.iterfind("ModelVariables/*")
    }
    if len(known) != len(root.findall("ModelVariables/*")):
        yield "variables share a value reference"
    for section in SECTIONS:
        unknowns = root.findall(f"ModelStructure/{section}")
        references = [int(unknown.get("valueReference", "-1")) for unknown in unknowns]
        if references != sorted(set(references)) and section != DERIVATIVES:
            yield f"ModelStructure/{section}: value references are not ascending, each once"
        for unknown in unknowns:
            yield from _unknown_problems(section, unknown, known)
    stated = sorted(
        unknown.get("valueReference", "")
        for unknown in root.iterfind(f"ModelStructure/{DERIVATIVES}")
    )
    if stated != sorted(
        variable.get("valueReference", "")
        for variable in known.values()
        if variable.get("derivative") is not None
    ):
        yield f"ModelStructure/{DERIVATIVES} does not name each derivative of a state once"


def _unknown_problems(
    section: str, unknown: Element, known: Mapping[int, Element]
) -> Iterator[str]:
    """Yields the problems of one entry of ModelStructure."""
    where = f"ModelStructure/{section} {unknown.get('valueReference')}"
    variable = known.get(int(unknown.get("valueReference", "-1")))
    if variable is None:
        yield f"{where}: no such variable, there are {len(known)}"
        return
    if section == "Output" and variable.get("causality") != "output":
        yield f"{where}: {variable.get('name')} is no output"
    yield from dependency_problems(where, unknown, known)
