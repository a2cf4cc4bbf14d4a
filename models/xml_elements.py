"""Adds elements to XML trees, with numbers in full precision."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping

Value = str | float | Iterable[float]


def numbers(values: Iterable[float]) -> str:
    """Returns the numbers in full precision, separated by blanks."""
    return " ".join(repr(float(value)) for value in values)


def text(value: Value) -> str:
    """Returns the text of an attribute."""
    if isinstance(value, str):
        return value
    return numbers(value) if isinstance(value, Iterable) else repr(float(value))


def add(
    parent: ET.Element, tag: str, /, *groups: Mapping[str, str], **attributes: Value
) -> ET.Element:
    """Adds an element with groups of attributes and further ones, and returns it."""
    element = ET.SubElement(parent, tag)
    for group in groups:
        element.attrib |= group
    element.attrib |= {key: text(value) for key, value in attributes.items()}
    return element


def written(root: ET.Element) -> str:
    """Returns the text of a file."""
    ET.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
