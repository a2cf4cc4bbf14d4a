"""Reads a URDF's links and joints, and the element <hexapod> with sections that URDF lacks.

Raises RobotError, which names the element.

Format: wiki.ros.org/urdf/XML. Rotations are matrices that convert components in the element to
components in its parent.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.kinematics import inertia_matrix
from hexapod_cosim.models.xml_elements import name_of, number, numbers, origin, read_root

EXTENSION = "hexapod"  # element of this project for data that URDF lacks
MOVING = ("revolute", "continuous")
KINDS = (*MOVING, "fixed", "floating")
EFFECTIVE = ("link", "joint", EXTENSION, "material", "mujoco")  # others are listed as ignored
AXIS_TOLERANCE = 1e-6  # an axis this close to unit length is not normalised


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass [kg], centre of mass [m] and inertia about it [kg m2] in the link's frame."""

    mass: float
    com: Array  # (3,)
    inertia: Array  # (3, 3)


@dataclass(frozen=True, eq=False)
class Sphere:
    """A collision sphere in its link's frame [m]."""

    centre: Array  # (3,)
    radius: float


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """A link; of its collision shapes only spheres and boxes are read."""

    name: str
    inertial: Inertial | None
    spheres: tuple[Sphere, ...]
    box: Array | None  # (3,) m  extents along the link's axes of its first collision or visual box


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint between two links."""

    name: str
    kind: str
    parent: str
    child: str
    R_PL: Array  # (3, 3) child to parent at angle 0
    position: Array  # (3,) m    of the child's frame in the parent's
    yaw: float | None  # rad    of the rotation when it is about z alone
    axis: Array  # (3,) in the child's frame, unit length
    lower: float  # rad
    upper: float  # rad
    effort: float | None  # N m
    velocity: float | None  # rad/s
    friction: float  # N m
    damping: float  # N m s/rad


@dataclass(frozen=True, eq=False)
class Urdf:
    """The content of a file."""

    name: str
    where: str  # its file, for messages
    links: dict[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]
    extension: ET.Element | None
    ignored: Counter[str]  # elements without effect here


def parse_urdf(text: str | bytes, *, where: str) -> Urdf:
    """Reads a URDF. Raises RobotError."""
    root = read_root(text, where)
    ignored = Counter(element.tag for element in root if element.tag not in EFFECTIVE)
    elements = {kind: _named(root, kind, where) for kind in ("link", "joint")}
    links = {
        name: _link(element, f"{where}: link {name!r}", ignored)
        for name, element in elements["link"].items()
    }
    joints = tuple(
        _joint(element, f"{where}: joint {name!r}", ignored)
        for name, element in elements["joint"].items()
    )
    return Urdf(root.get("name") or "robot", where, links, joints, root.find(EXTENSION), ignored)


def _named(root: ET.Element, kind: str, where: str) -> dict[str, ET.Element]:
    """Returns the elements of a kind by their names, which differ."""
    found: dict[str, ET.Element] = {}
    for element in root.findall(kind):
        name = name_of(element, where)
        if name in found:
            fix = "rename one"
            raise RobotError(f"a {kind} twice", got=name, expected="names", fix=fix, where=where)
        found[name] = element
    return found


def _link(element: ET.Element, where: str, ignored: Counter[str]) -> UrdfLink:
    spheres, boxes = [], []
    for tag in ("collision", "visual"):
        for shape in element.findall(tag):
            at = f"{where}: {tag}"
            R_LO, p_L, _ = origin(shape, at)
            for geometry in shape.findall("geometry/*"):
                ignored["mesh"] += geometry.tag == "mesh"
                if geometry.tag == "box":
                    boxes.append(np.abs(R_LO) @ numbers(geometry, "size", None, at))
                if tag == "collision" and geometry.tag == "sphere":
                    spheres.append(Sphere(p_L, number(geometry, "radius", None, at)))
    box = boxes[0] if boxes else None
    return UrdfLink(element.get("name", ""), _inertial(element, where), tuple(spheres), box)


def _inertial(link: ET.Element, where: str) -> Inertial | None:
    """Returns mass and inertia, None without mass; a point mass has no moments."""
    element = link.find("inertial")
    if element is None:
        return None
    at = f"{where}: inertial"
    mass = number(element.find("mass"), "value", None, at)
    if mass < 0.0:
        raise RobotError("negative mass", got=mass, expected=">= 0 kg", fix="correct it", where=at)
    R_LO, p_L, _ = origin(element, at)
    table = element.find("inertia")
    moments = [number(table, key, None, at) for key in ("ixx", "iyy", "izz")]
    products = [number(table, key, 0.0, at) for key in ("ixy", "ixz", "iyz")]
    inertia = inertia_matrix((*moments, *products))
    return Inertial(mass, p_L, R_LO @ inertia @ R_LO.T + 0.0) if mass > 0.0 else None


def _joint(element: ET.Element, where: str, ignored: Counter[str]) -> UrdfJoint:
    kind = element.get("type", "")
    if kind not in KINDS:
        raise unknown_name("joint type", kind, KINDS, where=where, error=RobotError)
    moves = kind in MOVING
    mimic = element.find("mimic")
    if moves and mimic is not None:
        what, got = "a joint that follows another", f"mimics {mimic.get('joint')!r}"
        fix, expected = "remove <mimic>", "joints with motors of their own"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where)
    R_PL, p_P, angles = origin(element, where)
    dynamics = element.find("dynamics")
    limit, (lower, upper) = element.find("limit"), _limits(element, kind, where, ignored)
    return UrdfJoint(
        name=element.get("name", ""),
        kind=kind,
        parent=_end(element, "parent", where),
        child=_end(element, "child", where),
        R_PL=R_PL,
        position=p_P,
        yaw=angles[2] if angles[:2] == [0.0, 0.0] else None,
        axis=_axis(element, where) if moves else np.zeros(3),
        lower=lower,
        upper=upper,
        effort=_optional(limit, "effort", where),
        velocity=_optional(limit, "velocity", where),
        friction=number(dynamics, "friction", 0.0, where) if moves else 0.0,
        damping=number(dynamics, "damping", 0.0, where) if moves else 0.0,
    )


def _end(element: ET.Element, tag: str, where: str) -> str:
    end = element.find(tag)
    name = None if end is None else end.get("link")
    if not name:
        example = f'<{tag} link="..."/>'
        raise RobotError(f"a joint without {tag}", expected=example, fix="add it", where=where)
    return name


def _axis(element: ET.Element, where: str) -> Array:
    axis = numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0), where)
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        what, at = "an axis without direction", f"{where}: axis"
        raise RobotError(what, got=axis.tolist(), expected="xyz", fix="correct it", where=at)
    return axis if abs(length - 1.0) <= AXIS_TOLERANCE else axis / length


def _optional(limit: ET.Element | None, key: str, where: str) -> float | None:
    """Returns a limit if it is given; exporters write 0 for an unknown one."""
    value = number(limit, key, 0.0, where)
    return abs(value) or None


def _limits(
    element: ET.Element, kind: str, where: str, ignored: Counter[str]
) -> tuple[float, float]:
    """Returns the lower and upper limit [rad], of half a turn at most."""
    if kind != "revolute":
        return -math.pi, math.pi
    limit = element.find("limit")
    lower, upper = number(limit, "lower", 0.0, where), number(limit, "upper", 0.0, where)
    if not lower < upper:
        what = "limits not ordered"
        expected = "<limit> with lower < upper [rad]"
        fix = "correct them, or make the joint continuous"
        raise RobotError(what, got=[lower, upper], expected=expected, fix=fix, where=where)
    ignored["limits beyond half a turn"] += lower < -math.pi or upper > math.pi
    return max(lower, -math.pi), min(upper, math.pi)


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
