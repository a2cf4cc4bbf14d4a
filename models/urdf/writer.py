"""Writes a robot as a URDF that load_robot() reads back to the last bit.

Links and joints have this project's frames. The element <hexapod> contains data that URDF lacks;
other readers skip it. <mujoco> keeps MuJoCo from fixing the torso to the world.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable

from hexapod_cosim.models.arrays import Vector3
from hexapod_cosim.models.contact.law import BodyContact
from hexapod_cosim.models.ground.surface import Terrain
from hexapod_cosim.models.ground.table import terrain_table
from hexapod_cosim.models.records import JOINT_NAMES, Leg, Link, Robot
from hexapod_cosim.models.schema import specs
from hexapod_cosim.models.urdf.elements import EXTENSION
from hexapod_cosim.models.xml_elements import add, joined, text, written

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
    compiler = add(add(root, "mujoco"), "compiler", fusestatic="false", discardvisual="false")
    compiler.set("inertiafromgeom", "false")  # the feet's spheres weigh nothing
    for name, colour in COLOURS.items():
        add(add(root, "material", name=name), "color", rgba=colour)
    _torso(root, robot)
    for k, leg in enumerate(robot.legs):
        _leg(root, leg, robot, robot.owner_links(k))
    _extension(root, robot)
    return written(root)


def _torso(root: ET.Element, robot: Robot) -> None:
    torso = add(root, "link", name="torso")
    _inertial(torso, robot.torso.mass, robot.torso.com, robot.torso.inertia)
    visual = _shape(torso, "visual", robot.torso.com, "body")
    add(visual, "box", size=robot.torso.size)
    body = robot.body
    if body.contact == "on" and any(body.torso_box):
        collision = _shape(torso, "collision", body.torso_centre, None)
        edges = (2.0 * (half + body.corner_radius) for half in body.torso_box)
        add(collision, "box", size=edges)


def _leg(root: ET.Element, leg: Leg, robot: Robot, links: list[tuple[str, Link]]) -> None:
    """Adds a leg. links: with the names of their joints, as the owner counts the angles."""
    parent, place, yaw = "torso", leg.hip_position, leg.hip_yaw
    for name, (owners, link) in zip(JOINT_NAMES, links, strict=True):
        child = f"{leg.name}_{name}"
        limb = _limb(root, child, link, THICKNESS * robot.foot.radius)
        if name == "tibia" and robot.body.contact == "on":
            _tibia_spheres(limb, link, robot.body)
        joint = _joint(root, owners, "revolute", parent, child)
        add(joint, "origin", xyz=place, rpy=(0.0, 0.0, yaw))
        add(joint, "axis", xyz=link.axis)
        limit = add(joint, "limit", lower=link.angle_min, upper=link.angle_max)
        limit.attrib |= {
            "effort": repr(robot.servo.torque_limit),
            "velocity": repr(robot.servo.speed_max),
        }
        add(joint, "dynamics", damping="0.0", friction=robot.servo.coulomb_friction)
        parent, place, yaw = child, link.tip, 0.0
    _foot(root, f"{leg.name}_foot", parent, place, robot.foot.radius)


def _joint(root: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    joint = add(root, "joint", name=name, type=kind)
    add(joint, "parent", link=parent)
    add(joint, "child", link=child)
    return joint


def _tibia_spheres(tibia: ET.Element, link: Link, body: BodyContact) -> None:
    """Adds the spheres of knee and shank as collision shapes."""
    for _, radius, share in body.tibia_spheres:
        place = (share * value for value in link.tip)
        add(_shape(tibia, "collision", place, None), "sphere", radius=radius)


def _limb(root: ET.Element, name: str, link: Link, radius: float) -> ET.Element:
    element = add(root, "link", name=name)
    _inertial(element, link.mass, link.com, link.inertia)
    middle = tuple(0.5 * value for value in link.tip)
    visual = _shape(element, "visual", middle, "limb", rpy=direction_rpy(link.tip))
    add(visual, "cylinder", radius=radius, length=math.hypot(*link.tip))
    return element


def _foot(root: ET.Element, name: str, parent: str, place: Vector3, radius: float) -> None:
    """Adds a link without mass, so that other programs have the foot's centre as a frame."""
    link = add(root, "link", name=name)
    for tag in ("visual", "collision"):
        shape = _shape(link, tag, (0.0, 0.0, 0.0), "rubber" if tag == "visual" else None)
        add(shape, "sphere", radius=radius)
    joint = _joint(root, f"{name}_joint", "fixed", parent, name)
    add(joint, "origin", xyz=place, rpy="0 0 0")


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
    shape = add(link, tag)
    add(shape, "origin", xyz=place, rpy=rpy)
    geometry = add(shape, "geometry")
    if material is not None:
        add(shape, "material", name=material)
    return geometry


def _inertial(link: ET.Element, mass: float, com: Vector3, inertia: tuple[float, ...]) -> None:
    element = add(link, "inertial")
    add(element, "origin", xyz=com, rpy="0 0 0")
    add(element, "mass", value=mass)
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    add(element, "inertia", {name: repr(value) for name, value in zip(names, inertia, strict=True)})


def _extension(root: ET.Element, robot: Robot) -> None:
    own = add(root, EXTENSION, frames="ours")
    add(own, "world", gravity=robot.gravity)
    add(own, "torso", size=robot.torso.size)
    for name in RECORDS:
        record = getattr(robot, name)
        if name == "terrain":
            _terrain(own, record)
            continue
        add(own, name, {key: text(getattr(record, key)) for key in specs(type(record))})
    for leg, signs in zip(robot.legs, robot.joints.signs.reshape(-1, 3), strict=True):
        add(own, leg.name, stance=leg.stance, signs=signs.tolist())


def _terrain(own: ET.Element, terrain: Terrain) -> None:
    """Writes the ground: keys as attributes, patches as elements."""
    table = terrain_table(terrain)
    patches = table.pop("patch", [])
    element = add(own, "terrain", {key: text(value) for key, value in table.items()})
    for patch in patches:
        values = {key: value for key, value in patch.items() if key != "size"}
        attributes = {key: text(value) for key, value in values.items()}
        add(element, "patch", attributes | {"size": joined(patch["size"])})
