"""Writes a robot as a URDF that load_robot() reads back to the last bit.

Links and joints have this project's frames. The element <hexapod> contains data that URDF lacks;
other readers skip it. <mujoco> keeps MuJoCo from fixing the torso to the world.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from typing import Any

from hexapod_cosim.models.arrays import Vector3
from hexapod_cosim.models.ground.table import terrain_table
from hexapod_cosim.models.records import JOINT_NAMES, BodyContact, Leg, Link, Robot, Terrain
from hexapod_cosim.models.schema import specs
from hexapod_cosim.models.urdf.elements import EXTENSION

RECORDS = (
    "foot",
    "contact",
    "friction",
    "servo",
    "baumgarte",
    "solver",
    "terrain",
    "gait",
    "body",
    "soil",
)
THICKNESS = 0.7  # 1  radius of a drawn link over the foot's
COLOURS = {"body": "0.30 0.33 0.38 1", "limb": "0.72 0.74 0.78 1", "rubber": "0.85 0.45 0.15 1"}


def robot_to_urdf(robot: Robot) -> str:
    """Returns the text of a URDF."""
    root = ET.Element("robot", name=robot.name)
    compiler = ET.SubElement(
        ET.SubElement(root, "mujoco"), "compiler", fusestatic="false", discardvisual="false"
    )
    compiler.set("inertiafromgeom", "false")  # the feet's spheres weigh nothing
    for name, colour in COLOURS.items():
        ET.SubElement(ET.SubElement(root, "material", name=name), "color", rgba=colour)
    _torso(root, robot)
    for leg in robot.legs:
        _leg(root, leg, robot)
    _extension(root, robot)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def numbers(values: Iterable[float]) -> str:
    """Returns the numbers in full precision, separated by blanks."""
    return " ".join(repr(float(value)) for value in values)


def _torso(root: ET.Element, robot: Robot) -> None:
    torso = ET.SubElement(root, "link", name="torso")
    _inertial(torso, robot.torso.mass, robot.torso.com, robot.torso.inertia)
    visual = _shape(torso, "visual", robot.torso.com, "body")
    ET.SubElement(visual, "box", size=numbers(robot.torso.size))
    body = robot.body
    if body.contact == "on" and any(body.torso_box):
        collision = _shape(torso, "collision", body.torso_centre, None)
        edges = (2.0 * (half + body.corner_radius) for half in body.torso_box)
        ET.SubElement(collision, "box", size=numbers(edges))


def _leg(root: ET.Element, leg: Leg, robot: Robot) -> None:
    parent, place, yaw = "torso", leg.hip_position, leg.hip_yaw
    for name, link in zip(JOINT_NAMES, leg.links, strict=True):
        child = f"{leg.name}_{name}"
        limb = _limb(root, child, link, THICKNESS * robot.foot.radius)
        if name == "tibia" and robot.body.contact == "on":
            _tibia_spheres(limb, link, robot.body)
        joint = _joint(root, f"{child}_joint", "revolute", parent, child)
        ET.SubElement(joint, "origin", xyz=numbers(place), rpy=numbers((0.0, 0.0, yaw)))
        ET.SubElement(joint, "axis", xyz=numbers(link.axis))
        limit = ET.SubElement(
            joint, "limit", lower=repr(link.angle_min), upper=repr(link.angle_max)
        )
        limit.attrib |= {
            "effort": repr(robot.servo.torque_max),
            "velocity": repr(robot.servo.speed_max),
        }
        ET.SubElement(joint, "dynamics", damping="0.0", friction=repr(robot.servo.coulomb_friction))
        parent, place, yaw = child, link.tip, 0.0
    _foot(root, f"{leg.name}_foot", parent, place, robot.foot.radius)


def _joint(root: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    joint = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    return joint


def _tibia_spheres(tibia: ET.Element, link: Link, body: BodyContact) -> None:
    """Adds the spheres of knee and shank as collision shapes."""
    for radius, share in ((body.knee_radius, 0.0), (body.shank_radius, body.shank_position)):
        if radius > 0.0:
            place = (share * value for value in link.tip)
            ET.SubElement(_shape(tibia, "collision", place, None), "sphere", radius=repr(radius))


def _limb(root: ET.Element, name: str, link: Link, radius: float) -> ET.Element:
    element = ET.SubElement(root, "link", name=name)
    _inertial(element, link.mass, link.com, link.inertia)
    middle = tuple(0.5 * value for value in link.tip)
    visual = _shape(element, "visual", middle, "limb", rpy=direction_rpy(link.tip))
    ET.SubElement(visual, "cylinder", radius=repr(radius), length=repr(math.hypot(*link.tip)))
    return element


def _foot(root: ET.Element, name: str, parent: str, place: Vector3, radius: float) -> None:
    """Adds a link without mass, so that other programs have the foot's centre as a frame."""
    link = ET.SubElement(root, "link", name=name)
    for tag in ("visual", "collision"):
        shape = _shape(link, tag, (0.0, 0.0, 0.0), "rubber" if tag == "visual" else None)
        ET.SubElement(shape, "sphere", radius=repr(radius))
    joint = _joint(root, f"{name}_joint", "fixed", parent, name)
    ET.SubElement(joint, "origin", xyz=numbers(place), rpy="0 0 0")


def direction_rpy(way: Vector3) -> Vector3:
    """Returns roll, pitch and yaw of a rotation of z to a direction."""
    x, y, z = way
    return (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x))


def _shape(
    link: ET.Element,
    tag: str,
    place: Iterable[float],
    material: str | None,
    rpy: Vector3 = (0.0, 0.0, 0.0),
) -> ET.Element:
    shape = ET.SubElement(link, tag)
    ET.SubElement(shape, "origin", xyz=numbers(place), rpy=numbers(rpy))
    geometry = ET.SubElement(shape, "geometry")
    if material is not None:
        ET.SubElement(shape, "material", name=material)
    return geometry


def _inertial(link: ET.Element, mass: float, com: Vector3, inertia: tuple[float, ...]) -> None:
    element = ET.SubElement(link, "inertial")
    ET.SubElement(element, "origin", xyz=numbers(com), rpy="0 0 0")
    ET.SubElement(element, "mass", value=repr(mass))
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    ET.SubElement(
        element, "inertia", {name: repr(value) for name, value in zip(names, inertia, strict=True)}
    )


def _extension(root: ET.Element, robot: Robot) -> None:
    own = ET.SubElement(root, EXTENSION, frames="ours")
    ET.SubElement(own, "world", gravity=numbers(robot.gravity))
    ET.SubElement(own, "torso", size=numbers(robot.torso.size))
    for name in RECORDS:
        record = getattr(robot, name)
        if name == "terrain":
            _terrain(own, record)
            continue
        ET.SubElement(own, name, {key: _text(getattr(record, key)) for key in specs(type(record))})
    for leg in robot.legs:
        ET.SubElement(own, leg.name, stance=numbers(leg.stance))


def _terrain(own: ET.Element, terrain: Terrain) -> None:
    """Writes the ground: keys as attributes, patches as elements."""
    table = terrain_table(terrain)
    patches = table.pop("patch", [])
    element = ET.SubElement(own, "terrain", {key: _text(value) for key, value in table.items()})
    for patch in patches:
        values = {key: value for key, value in patch.items() if key != "size"}
        attributes = {key: _text(value) for key, value in values.items()}
        ET.SubElement(element, "patch", attributes | {"size": numbers(patch["size"])})


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        return numbers(value)
    return value if isinstance(value, str) else repr(float(value))
