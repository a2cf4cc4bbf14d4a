"""Provides random robots, and writes any robot as an equivalent URDF with other frames, signs,
parts and names.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hexapod_cosim.models import Link, Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.kinematics import inertia_matrix
from hexapod_cosim.models.records import JOINT_NAMES, LEG_NAMES


def random_robot(seed: int, *, pattern: bool) -> Robot:
    """Returns a robot whose six legs all differ: lengths, offsets, masses of random bodies, yaws,
    limits.

    Its axes are those that the controller requires, or any.
    """
    rng, robot = np.random.default_rng(seed), load_robot(("athena", "phantomx_mk4")[seed % 2])
    mass, com, inertia = _random_matter(rng, 3.0, np.array(robot.torso.size))
    legs = [
        replace(
            leg,
            hip_position=_triple(np.array(leg.hip_position) + rng.normal(0.0, 0.003, 3)),
            hip_yaw=leg.hip_yaw + float(rng.normal(0.0, 0.1)),
            links=_random_links(leg.links, rng, pattern=pattern),
        )
        for leg in robot.legs
    ]
    return replace(
        robot,
        name=f"random{seed}",
        torso=replace(robot.torso, mass=mass, com=com, inertia=inertia),
        legs=tuple(legs),
    )


def _random_links(
    links: tuple[Link, Link, Link], rng: np.random.Generator, *, pattern: bool
) -> tuple[Link, Link, Link]:
    coxa, femur, tibia = (_random_link(link, rng, pattern=pattern) for link in links)
    return coxa, femur, tibia


def _random_link(link: Link, rng: np.random.Generator, *, pattern: bool) -> Link:
    mass, com, inertia = _random_matter(rng, 0.3, np.array([0.1, 0.03, 0.03]))
    axis = np.array(link.axis) + (0.0 if pattern else 1.0) * rng.normal(0.0, 0.02, 3)
    y, z, extra = rng.normal(0.0, 0.0015, 3).tolist()
    return replace(
        link,
        mass=mass,
        com=com,
        inertia=inertia,
        axis=_triple(axis / np.linalg.norm(axis)),
        length=link.length + extra,
        offset_y=link.offset_y + y,
        offset_z=link.offset_z + z,
        angle_max=link.angle_max + float(rng.uniform(0.0, 0.1)),
    )


def _random_matter(rng: np.random.Generator, mass: float, size: Array) -> tuple[float, Any, Any]:
    """Returns mass, centre of mass and inertia of ten point masses, which a real body can have."""
    weights, points = (
        rng.uniform(0.5, 1.5, 10) * mass / 10.0,
        rng.uniform(-0.5, 0.5, (10, 3)) * size,
    )
    com = weights @ points / weights.sum()
    arms = points - com
    inertia = sum(
        w * (d @ d * np.eye(3) - np.outer(d, d)) for w, d in zip(weights, arms, strict=True)
    )
    entries = tuple(float(inertia[k]) for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return float(weights.sum()), _triple(com), entries


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return (x, y, z)


def disguised(robot: Robot, seed: int, extension: str = "") -> str:
    """Returns a URDF of the robot with other frames, order and names.

    The frames of the links are turned at random, the joints count in the opposite direction, and
    the mass of each link is split in two. `extension` is inserted at the end.
    """
    rng = np.random.default_rng(seed)
    root = ET.Element("robot", name=robot.name)
    torso = _halves(
        root,
        "trunk",
        robot.torso.mass,
        np.array(robot.torso.com),
        inertia_matrix(robot.torso.inertia),
        rng,
    )
    ET.SubElement(
        ET.SubElement(ET.SubElement(torso, "visual"), "geometry"),
        "box",
        size=_text(robot.torso.size),
    )
    for k in rng.permutation(6):
        _disguised_leg(root, int(k), robot, rng)
    return ET.tostring(root, encoding="unicode").replace("</robot>", f"{extension}</robot>")


def _disguised_leg(root: ET.Element, number: int, robot: Robot, rng: np.random.Generator) -> None:
    leg = robot.legs[number]
    parent, R_above, place, R_hip = (
        "trunk",
        np.eye(3),
        np.array(leg.hip_position),
        _turn(0.0, 0.0, leg.hip_yaw),
    )
    for joint, link in zip("xyz", leg.links, strict=True):
        # R and R_above: rotation from the axes of this link and of its parent to the torso's, at
        # angle 0
        name, R, sign = (
            f"l{number}{joint}",
            R_hip @ _turn(*rng.uniform(-1.5, 1.5, 3)),
            float(rng.choice((-1.0, 1.0))),
        )
        to_link = R.T @ R_hip
        _halves(
            root,
            name,
            link.mass,
            to_link @ np.array(link.com),
            to_link @ inertia_matrix(link.inertia) @ to_link.T,
            rng,
        )
        element = _joint(
            root, f"{name}_joint", parent, name, "revolute", R_above.T @ place, R_above.T @ R
        )
        ET.SubElement(element, "axis", xyz=_text(sign * (to_link @ np.array(link.axis))))
        low, high = sorted((sign * link.angle_min, sign * link.angle_max))
        limit = ET.SubElement(
            element, "limit", lower=repr(low), upper=repr(high), effort=repr(robot.servo.torque_max)
        )
        limit.set("velocity", repr(robot.servo.speed_max))
        ET.SubElement(element, "dynamics", friction=repr(robot.servo.coulomb_friction))
        parent, R_above, place = name, R, R_hip @ np.array(link.tip)
    name = f"l{number}foot"
    foot = ET.SubElement(root, "link", name=name)
    geometry = ET.SubElement(ET.SubElement(foot, "collision"), "geometry")
    ET.SubElement(geometry, "sphere", radius=repr(robot.foot.radius))
    _joint(root, f"{name}_joint", parent, name, "fixed", R_above.T @ place, np.eye(3))


def stances(robot: Robot) -> str:
    """Returns the `<hexapod>` element with the stance and the servos."""
    servo = robot.servo
    legs = "".join(f'<{leg.name} stance="{_text(leg.stance)}"/>' for leg in robot.legs)
    gains = f'kp="{servo.kp}" kd="{servo.kd}" rotor_inertia="{servo.rotor_inertia}"'
    return f"<hexapod>{legs}<servo {gains}/></hexapod>"


def _halves(
    root: ET.Element, name: str, mass: float, com: Array, inertia: Array, rng: np.random.Generator
) -> ET.Element:
    """Returns a link with half of the mass and a second one, turned and fixed to it, with the other
    half.

    Together they have the inertia.
    """
    d, Q = rng.normal(0.0, 1e-3, 3), _turn(*rng.uniform(-1.5, 1.5, 3))
    part = 0.5 * inertia - 0.5 * mass * (d @ d * np.eye(3) - np.outer(d, d))
    link = ET.SubElement(root, "link", name=name)
    _inertial(link, 0.5 * mass, com + d, part)
    other = ET.SubElement(root, "link", name=f"{name}_half")
    place = rng.normal(0.0, 0.01, 3)
    _inertial(other, 0.5 * mass, Q.T @ (com - d - place), Q.T @ part @ Q)
    _joint(root, f"{name}_half_joint", name, f"{name}_half", "fixed", place, Q)
    return link


def _inertial(link: ET.Element, mass: float, com: Array, inertia: Array) -> None:
    element = ET.SubElement(link, "inertial")
    ET.SubElement(element, "origin", xyz=_text(com))
    ET.SubElement(element, "mass", value=repr(mass))
    entries = {
        "ixx": (0, 0),
        "iyy": (1, 1),
        "izz": (2, 2),
        "ixy": (0, 1),
        "ixz": (0, 2),
        "iyz": (1, 2),
    }
    ET.SubElement(
        element, "inertia", {key: repr(float(inertia[place])) for key, place in entries.items()}
    )


def _joint(
    root: ET.Element, name: str, parent: str, child: str, kind: str, place: Array, R: Array
) -> ET.Element:
    joint = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    rpy = (math.atan2(R[2, 1], R[2, 2]), -math.asin(R[2, 0]), math.atan2(R[1, 0], R[0, 0]))
    ET.SubElement(joint, "origin", xyz=_text(place), rpy=_text(rpy))
    return joint


def _turn(roll: float, pitch: float, yaw: float) -> Array:
    """Returns the rotation (3, 3) Rz Ry Rx as a product of matrices, unlike the importer's closed
    form.
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos((roll, pitch, yaw)), np.sin((roll, pitch, yaw))
    Rx = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    Ry = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    Rz = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(Rz @ Ry @ Rx)


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def differences(a: Robot, b: Robot) -> Mapping[str, float]:
    """Returns the largest absolute differences between the bodies of two robots, by quantity."""
    found: dict[str, float] = {}
    pairs: list[tuple[str, Any, Any]] = [("torso", a.torso, b.torso)]
    for leg, x, y in zip(LEG_NAMES, a.legs, b.legs, strict=True):
        pairs += [
            (f"{leg} hip", x, y),
            *((f"{leg} {joint}", x.links[k], y.links[k]) for k, joint in enumerate(JOINT_NAMES)),
        ]
    for name, x, y in pairs:
        for key, value in vars(x).items():
            if key not in ("name", "links"):
                found[f"{name} {key}"] = float(np.max(np.abs(np.subtract(value, getattr(y, key)))))
    return found
