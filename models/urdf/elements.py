"""Reads a URDF's links and joints and checks each element.

Raises RobotError, which names the element.

Format: wiki.ros.org/urdf/XML. Rotations are matrices that convert components in the element to
components in its parent.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError, unknown_name
from hexapod_cosim.models.kinematics import inertia_matrix
from hexapod_cosim.models.urdf.collision import Solid, read_solids
from hexapod_cosim.models.urdf.values import name_of, number, numbers, origin, read_root
from hexapod_cosim.models.validation import check_inertia

EXTENSION = "hexapod"  # element of this project for data that URDF lacks
MOVING = ("revolute", "continuous")
KINDS = (*MOVING, "fixed", "floating", "prismatic", "planar")
SILENT = ("link", "joint", EXTENSION, "material", "mujoco")  # all others are told to have no effect
AXIS_TOLERANCE = 1e-6  # an axis this close to unit length is not normalised
DAMPING = "damping"  # a side file may ignore it


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass [kg], centre of mass [m] and inertia about it [kg m2] in the link's frame."""

    mass: float
    com: Array  # (3,)
    inertia: Array  # (3, 3)
    problem: RobotError | None = (
        None  # why no body can be so; to be raised unless someone else gives the inertia
    )


@dataclass(frozen=True, eq=False)
class Sphere:
    """A collision sphere in the link's frame [m]."""

    centre: Array  # (3,)
    radius: float


@dataclass(frozen=True, eq=False)
class UrdfLink:
    name: str
    inertial: Inertial | None
    spheres: tuple[Sphere, ...]
    box: (
        Array | None
        # (3,) m    extents along the link's axes of its first collision box, else of its first
        # visual one
    )
    solids: tuple[Solid, ...] = ()  # its collision shapes but meshes


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    name: str
    kind: str
    parent: str
    child: str
    rotation: Array  # (3, 3) child to parent at angle 0
    position: Array  # (3,) m    of the child's frame in the parent's
    yaw: float | None  # rad    of the rotation when it is about z alone
    axis: Array  # (3,) in the child's frame, unit length
    lower: float  # rad
    upper: float  # rad
    effort: float | None  # N m
    velocity: float | None  # rad/s
    friction: float  # N m


@dataclass(frozen=True, eq=False)
class Urdf:
    name: str
    where: str  # its file, for messages
    links: dict[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]
    extension: ET.Element | None
    ignored: Counter[str]  # elements without effect here


def parse_urdf(text: str | bytes, *, where: str, ignore: tuple[str, ...] = ()) -> Urdf:
    """Reads a URDF; `ignore` may contain "damping". Raises RobotError."""
    root = read_root(text, where)
    ignored: Counter[str] = Counter()
    links = [
        _link(element, f"{where}: link {name_of(element, where)!r}", ignored)
        for element in root.findall("link")
    ]
    joints = [
        _joint(element, f"{where}: joint {name_of(element, where)!r}", ignore, ignored)
        for element in root.findall("joint")
    ]
    ignored.update(element.tag for element in root if element.tag not in SILENT)
    _check_unique_names([link.name for link in links], "link", where)
    _check_unique_names([joint.name for joint in joints], "joint", where)
    return Urdf(
        root.get("name") or "robot",
        where,
        {link.name: link for link in links},
        tuple(joints),
        root.find(EXTENSION),
        ignored,
    )


def _check_unique_names(names: list[str], kind: str, where: str) -> None:
    twins = [name for name, count in Counter(names).items() if count > 1]
    if twins:
        raise RobotError(
            f"a {kind} twice",
            got=twins[0],
            expected="different names",
            fix="rename one",
            where=where,
        )


def _link(element: ET.Element, where: str, ignored: Counter[str]) -> UrdfLink:
    spheres, boxes = [], []
    for tag in ("collision", "visual"):
        for shape in element.findall(tag):
            R, p, _ = origin(shape, f"{where}: {tag}")
            sphere, box = shape.find("geometry/sphere"), shape.find("geometry/box")
            ignored["mesh"] += shape.find("geometry/mesh") is not None
            if sphere is not None and tag == "collision":
                spheres.append(Sphere(p, number(sphere, "radius", None, f"{where}: {tag}")))
            if box is not None:
                boxes.append(np.abs(R) @ numbers(box, "size", None, f"{where}: {tag}"))
    return UrdfLink(
        element.get("name", ""),
        _inertial(element, where),
        tuple(spheres),
        boxes[0] if boxes else None,
        read_solids(element, where),
    )


def _inertial(link: ET.Element, where: str) -> Inertial | None:
    element = link.find("inertial")
    if element is None:
        return None
    at = f"{where}: inertial"
    mass = number(element.find("mass"), "value", None, at)
    if mass < 0.0:
        raise RobotError("negative mass", got=mass, expected=">= 0 kg", fix="correct it", where=at)
    R, p, _ = origin(element, at)
    table = element.find("inertia")
    moments = tuple(
        number(table, key, None if key in ("ixx", "iyy", "izz") else 0.0, at)
        for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    if mass == 0.0:
        return None
    return Inertial(
        mass,
        p,
        R @ inertia_matrix(moments) @ R.T + 0.0,
        _problem(mass, moments, at) if any(moments) else None,
    )  # none: a point mass


def _problem(mass: float, moments: tuple[float, ...], where: str) -> RobotError | None:
    try:
        check_inertia(mass, moments, math.inf, where)
    except RobotError as error:
        return error
    return None


def _joint(
    element: ET.Element, where: str, ignore: tuple[str, ...], ignored: Counter[str]
) -> UrdfJoint:
    kind = element.get("type", "")
    if kind not in KINDS:
        raise unknown_name("joint type", kind, KINDS, where=where, error=RobotError)
    if kind in ("prismatic", "planar"):
        raise RobotError(
            "a joint that slides",
            got=kind,
            expected="revolute, continuous or fixed",
            fix="make it fixed",
            where=where,
        )
    moves = kind in MOVING
    if moves:
        _refuse_mimic(element, where)
    R, p, angles = origin(element, where)
    limit, lower, upper = _limits(element, kind, where, ignored)
    return UrdfJoint(
        name=element.get("name", ""),
        kind=kind,
        parent=_end(element, "parent", where),
        child=_end(element, "child", where),
        rotation=R,
        position=p,
        yaw=angles[2] if angles[:2] == [0.0, 0.0] else None,
        axis=_axis(element, where) if moves else np.zeros(3),
        lower=lower,
        upper=upper,
        effort=_optional(limit, "effort", where),
        velocity=_optional(limit, "velocity", where),
        friction=_friction(element, where, ignore, ignored) if moves else 0.0,
    )


def _refuse_mimic(element: ET.Element, where: str) -> None:
    mimic = element.find("mimic")
    if mimic is not None:
        got = f"mimics {mimic.get('joint')!r}"
        raise RobotError(
            "a joint that follows another",
            got=got,
            expected="joints of their own",
            fix="remove <mimic>",
            where=where,
        )


def _end(element: ET.Element, tag: str, where: str) -> str:
    end = element.find(tag)
    name = None if end is None else end.get("link")
    if not name:
        raise RobotError(
            f"a joint without {tag}", expected=f'<{tag} link="..."/>', fix="add it", where=where
        )
    return name


def _axis(element: ET.Element, where: str) -> Array:
    axis = numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0), where)
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise RobotError(
            "an axis without direction",
            got=axis.tolist(),
            expected="a direction",
            fix="correct it",
            where=f"{where}: axis",
        )
    return axis if abs(length - 1.0) <= AXIS_TOLERANCE else axis / length


def _optional(limit: ET.Element | None, key: str, where: str) -> float | None:
    """Returns a limit if it is given; exporters write 0 for an unknown one."""
    value = number(limit, key, 0.0, where)
    return abs(value) or None


def _limits(
    element: ET.Element, kind: str, where: str, ignored: Counter[str]
) -> tuple[ET.Element | None, float, float]:
    limit = element.find("limit")
    if kind == "revolute" and limit is None:
        example = '<limit lower="..." upper="..." effort="..." velocity="..."/>'
        fix = f"add {example}, or make it continuous"
        raise RobotError(
            "a revolute joint without limits", expected="<limit>", fix=fix, where=where
        )
    if kind != "revolute":
        return limit, -math.pi, math.pi
    lower, upper = number(limit, "lower", 0.0, where), number(limit, "upper", 0.0, where)
    if not lower < upper:
        raise RobotError(
            "limits not ordered",
            got=[lower, upper],
            expected="lower < upper [rad]",
            fix="correct them",
            where=f"{where}: limit",
        )
    if lower < -math.pi or upper > math.pi:
        ignored["limits beyond half a turn"] += 1
    return limit, max(lower, -math.pi), min(upper, math.pi)


def _friction(
    element: ET.Element, where: str, ignore: tuple[str, ...], ignored: Counter[str]
) -> float:
    dynamics = element.find("dynamics")
    damping = number(dynamics, "damping", 0.0, where)
    if damping != 0.0 and DAMPING not in ignore:
        fix = (
            'put it into servo.kd and write `ignore = ["damping"]` under [urdf] '
            'of a robot file with file = "..."'
        )
        raise RobotError(
            "viscous damping in a joint",
            got=damping,
            expected="0 N m s/rad",
            fix=fix,
            where=f"{where}: dynamics",
        )
    ignored[DAMPING] += damping != 0.0
    return number(dynamics, "friction", 0.0, where)


def describe(ignored: Counter[str]) -> str:
    """Returns a text about elements without effect, empty if there are none."""
    return ", ".join(f"{count} {name}" for name, count in sorted(ignored.items()) if count)
