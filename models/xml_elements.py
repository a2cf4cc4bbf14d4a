"""Reads attributes of URDF elements, and adds elements to XML trees with full precision.

Readers raise RobotError, which names the element.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError

DECIMALS = re.compile(r"[+-]?\d*\.(\d{2,})")


class _Builder(ET.TreeBuilder):
    """Rejects document types, and with them external or expanding entities."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise ValueError(f"a document type, <!DOCTYPE {name}>")


def read_root(text: str | bytes, where: str) -> ET.Element:
    """Returns the <robot> element of a file."""
    try:
        root = ET.fromstring(text, parser=ET.XMLParser(target=_Builder()))
    except (ET.ParseError, ValueError, LookupError) as error:  # LookupError: an unknown encoding
        fix = "correct that place"
        raise RobotError(
            "not XML", got=str(error), expected="a URDF", fix=fix, where=where
        ) from error
    if any("xacro" in element.tag for element in root.iter()):
        fix = "expand them first: xacro my.urdf.xacro > my.urdf"
        raise RobotError("xacro macros", expected="a URDF", fix=fix, where=where)
    if root.tag != "robot":
        got, fix = f"<{root.tag}>", "give a URDF of a six-legged robot"
        raise RobotError("no URDF", got=got, expected="<robot>", fix=fix, where=where)
    return root


def name_of(element: ET.Element, where: str) -> str:
    """Returns the element's required name."""
    name = element.get("name")
    if not name:
        what = f"a {element.tag} without a name"
        raise RobotError(what, expected="name=...", fix="name it", where=where)
    return name


def numbers(
    element: ET.Element | None,
    key: str,
    default: tuple[float, ...] | None,
    where: str,
    count: int = 3,
) -> Array:
    """Returns the finite numbers (count,) of an attribute.

    Returns the default, if there is one, where the attribute or the element is missing.
    """
    text = None if element is None else element.get(key)
    if text is None and default is not None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.full(1, math.nan)
    if len(values) != count or not np.isfinite(values).all():
        expected = "a finite number" if count == 1 else f"{count} finite numbers"
        what, fix = f"no good {key}", f"correct {key}"
        at = f"{where}: {element.tag}" if element is not None else where
        raise RobotError(what, got=text, expected=expected, fix=fix, where=at)
    return values


def number(element: ET.Element | None, key: str, default: float | None, where: str) -> float:
    """Returns the finite number of an attribute, or the default."""
    return float(numbers(element, key, None if default is None else (default,), where, 1)[0])


def rpy_matrix(roll: float, pitch: float, yaw: float) -> Array:
    """Returns Rz(yaw) Ry(pitch) Rx(roll) (3, 3), exact for quarter turns."""
    (cr, sr), (cp, sp), (cy, sy) = _cos_sin(roll), _cos_sin(pitch), _cos_sin(yaw)
    matrix = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return matrix + 0.0  # no negative zeros


def _cos_sin(angle: float) -> tuple[float, float]:
    quarters = round(angle / (0.5 * math.pi))
    if angle == quarters * 0.5 * math.pi:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarters % 4]
    return math.cos(angle), math.sin(angle)


def _quarter_turn(value: float, word: str) -> float:
    """Returns an angle; one that equals a quarter turn to all its printed digits (1.57, 3.1416)
    becomes exact.
    """
    digits, quarters = DECIMALS.fullmatch(word), round(value / (0.5 * math.pi))
    exact = quarters * 0.5 * math.pi
    if digits is None or quarters == 0:
        return value
    scale = 10 ** min(len(digits[1]), 15)
    printed = (round(exact * scale), math.trunc(exact * scale))
    return exact if round(value * scale) in printed else value


def origin(element: ET.Element, where: str) -> tuple[Array, Array, list[float]]:
    """Returns rotation (3, 3), position (3,) [m] and roll, pitch, yaw [rad] of the element."""
    origin = element.find("origin")
    if origin is not None and origin.get("quat_xyzw"):
        what, fix = "a quaternion as origin", "write it as roll, pitch and yaw"
        raise RobotError(what, got="quat_xyzw", expected="rpy", fix=fix, where=where)
    given = numbers(origin, "rpy", (0.0, 0.0, 0.0), where).tolist()
    words = (origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split()
    angles = [_quarter_turn(value, word) for value, word in zip(given, words, strict=True)]
    return rpy_matrix(*angles), numbers(origin, "xyz", (0.0, 0.0, 0.0), where), angles


Value = str | float | Iterable[float]


def joined(values: Iterable[float]) -> str:
    """Returns the numbers in full precision, separated by blanks."""
    return " ".join(repr(float(value)) for value in values)


def text(value: Value) -> str:
    """Returns the text of an attribute."""
    if isinstance(value, str):
        return value
    return joined(value) if isinstance(value, Iterable) else repr(float(value))


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
