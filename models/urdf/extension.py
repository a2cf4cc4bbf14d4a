"""Reads the element <hexapod>, which contains the sections of robot files that URDF lacks."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.urdf.elements import EXTENSION, Urdf
from hexapod_cosim.models.urdf.values import number, numbers

Fields = Mapping[str, Any]  # specifications of attributes by name


def extension_tables(
    urdf: Urdf, fields: Mapping[str, Fields], entries: Mapping[str, Mapping[str, Fields]]
) -> dict[str, Any]:
    """Returns the tables of <hexapod>: each child is a section, its attributes have the fields'
    types.

    entries: elements within a section, each of which is an entry of a list.
    """
    tables: dict[str, Any] = {}
    for child in urdf.extension if urdf.extension is not None else ():
        where = f"{urdf.where}: {EXTENSION}: {child.tag}"
        if child.tag not in fields:
            raise unknown_name(
                "element",
                child.tag,
                list(fields),
                where=f"{urdf.where}: {EXTENSION}",
                error=RobotError,
            )
        tables[child.tag] = {
            key: _value(child, key, fields[child.tag], where) for key in child.attrib
        }
        inner = entries.get(child.tag, {})
        for entry in child:
            if entry.tag not in inner:
                raise unknown_name("element", entry.tag, inner, where=where, error=RobotError)
            values = {
                key: _value(entry, key, inner[entry.tag], f"{where}: {entry.tag}")
                for key in entry.attrib
            }
            tables[child.tag].setdefault(entry.tag, []).append(values)
    return tables


def _value(element: ET.Element, key: str, fields: Fields, where: str) -> Any:
    if key not in fields:
        raise unknown_name("attribute", key, list(fields), where=where, error=RobotError)
    kind = type(fields[key]).__name__
    if kind in ("Choice", "Text"):
        return element.get(key)
    return (
        numbers(element, key, None, where, fields[key].size).tolist()
        if kind == "Vector"
        else number(element, key, None, where)
    )
