"""Checks modelDescription.xml of FMI 2.0 for errors that its schema and fmpy do not find."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

import fmpy
from lxml import etree

from hexapod_cosim.cosim.validate.variable import Entry, declaration_problems, dependency_problems

SCHEMAS = Path(fmpy.__file__).parent / "schema"
KINDS = {"Real", "Integer", "Boolean", "String", "Enumeration"}


def schema_problems(member: str, data: bytes, schema: str) -> list[str]:
    """Returns a document's violations of a schema such as fmi3/fmi3TerminalsAndIcons.xsd."""
    try:
        document = etree.fromstring(data)
    except etree.XMLSyntaxError as error:
        return [f"{member} is no XML: {error}"]
    rules = etree.XMLSchema(etree.parse(str(SCHEMAS / schema)))
    rules.validate(document)
    return [f"{member} line {error.line}: {error.message}" for error in rules.error_log]


def description_problems(root: Element) -> list[str]:
    """Returns the problems of a document that its schema accepts, one sentence each."""
    types = [
        Entry(
            entry.get("name", ""),
            kind.tag,
            kind.attrib,
            items=tuple(item.get("value", "") for item in kind.iterfind("Item")),
        )
        for entry in root.iterfind("TypeDefinitions/SimpleType")
        for kind in entry
        if kind.tag in KINDS
    ]
    return [*declaration_problems(root, variables(root), types), *_structure_problems(root)]


def variables(root: Element) -> list[Entry]:
    """Returns each ScalarVariable with the attributes of its type's element."""
    return [
        Entry(variable.get("name", ""), kind.tag, kind.attrib, variable.get("description", ""))
        for variable in root.iterfind("ModelVariables/ScalarVariable")
        for kind in variable
        if kind.tag in KINDS
    ]


def _structure_problems(root: Element) -> Iterator[str]:
    """Yields invalid indices in ModelStructure, which count from 1."""
    ordered = list(root.iterfind("ModelVariables/ScalarVariable"))
    for section in root.iterfind("ModelStructure/*"):
        indices = [int(unknown.get("index", "0")) for unknown in section]
        if indices != sorted(set(indices)) and section.tag != "Derivatives":
            yield f"ModelStructure/{section.tag}: indices are not ascending, each once"
        for unknown in section:
            yield from _unknown_problems(section.tag, unknown, ordered)
    count = len(root.findall("ModelStructure/Derivatives/Unknown"))
    states = len([entry for entry in variables(root) if "derivative" in entry.attributes])
    if count != states:
        yield (
            f"ModelStructure/Derivatives has {count} entries, but {states} variables are "
            "derivatives"
        )


def _unknown_problems(section: str, unknown: Element, ordered: list[Element]) -> Iterator[str]:
    """Yields the problems of one entry of ModelStructure."""
    where = f"ModelStructure/{section} index {unknown.get('index')}"
    if not 1 <= int(unknown.get("index", "0")) <= len(ordered):
        yield f"{where}: no such variable, there are {len(ordered)}"
        return
    variable = ordered[int(unknown.get("index", "0")) - 1]
    if section == "Outputs" and variable.get("causality") != "output":
        yield f"{where}: {variable.get('name')} is no output"
    yield from dependency_problems(where, unknown, range(1, len(ordered) + 1))
