"""Computes the spheres of torso, knees and shanks from a URDF's collision elements.

The torso's box encloses its boxes, cylinders, spheres and capsules, along the torso's axes. A
cylinder or capsule of the femur gives the radius at the knee. One of the tibia gives that of the
shank and its place on the line to the foot. Spheres of the tibia besides the foot's give the knee
near the joint, else the shank. All legs have the largest of their sizes. Meshes are not read.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.urdf.values import number, numbers, origin

if TYPE_CHECKING:
    from hexapod_cosim.models.urdf.bodies import Body

NEAR_KNEE = 0.25  # 1  of the way from the tibia's joint to the foot; spheres below it are the knee


@dataclass(frozen=True, eq=False)
class Solid:
    """A collision shape in its link's frame [m]."""

    kind: str  # box, cylinder, sphere, capsule
    centre: Array  # (3,)
    rotation: Array  # (3, 3) shape to link
    half: Array  # (3,) half extents along the shape's axes
    radius: float  # m  0 for a box


def read_solids(link: ET.Element, where: str) -> tuple[Solid, ...]:
    """Returns the boxes, cylinders, spheres and capsules among a link's collision elements.

    Raises RobotError for impossible numbers.
    """
    found = []
    for shape in link.findall("collision"):
        at = f"{where}: collision"
        R, p, _ = origin(shape, at)
        geometry = shape.find("geometry")
        for kind in () if geometry is None else geometry:
            if kind.tag == "box":
                half = 0.5 * numbers(kind, "size", None, at)
                found.append(Solid("box", p, R, half, 0.0))
            elif kind.tag in ("cylinder", "sphere", "capsule"):
                found.append(_round(kind, p, R, at))
    return tuple(found)


def _round(kind: ET.Element, centre: Array, rotation: Array, where: str) -> Solid:
    """Returns a sphere, cylinder or capsule, whose axis is the shape's z."""
    radius = number(kind, "radius", None, where)
    along = radius
    if kind.tag != "sphere":
        along = 0.5 * number(kind, "length", None, where)
        along += radius if kind.tag == "capsule" else 0.0
    return Solid(kind.tag, centre, rotation, np.array([radius, radius, along]), radius)


def _solids(body: Body) -> list[Solid]:
    """Returns the solids of all links of a body, in the body's frame."""
    return [
        Solid(
            solid.kind,
            member.point(solid.centre),
            member.rotation @ solid.rotation,
            solid.half,
            solid.radius,
        )
        for member in body.members
        for solid in member.link.solids
    ]


def collision_body(
    torso: Body, origin_of_torso: Array, axes: Array, legs: list[tuple[Body, Body, Array]]
) -> dict[str, Any]:
    """Returns the keys of [body] that the collision elements give; empty without any.

    legs: femur, tibia and the foot's centre (3,) in the tibia's frame [m], of each leg.
    """
    table = _torso_box(torso, origin_of_torso, axes)
    knees, shanks = [], []
    for femur, tibia, foot in legs:
        knees += [solid.radius for solid in _solids(femur) if solid.kind in ("cylinder", "capsule")]
        for solid, share in _besides_foot(tibia, foot):
            if solid.kind == "sphere" and share < NEAR_KNEE:
                knees.append(solid.radius)
            else:
                shanks.append((solid.radius, share))
    if knees:
        table["knee_radius"] = max(knees)
    if shanks:
        table["shank_radius"], table["shank_position"] = max(shanks)
    return table | {"contact": "on"} if table else {}


def _torso_box(torso: Body, start: Array, axes: Array) -> dict[str, Any]:
    """Returns the box along the torso's axes that encloses its solids, if there are any."""
    low, high = [], []
    for solid in _solids(torso):
        centre = axes.T @ (solid.centre - start)
        half = np.abs(axes.T @ solid.rotation) @ solid.half
        low.append(centre - half)
        high.append(centre + half)
    if not low:
        return {}
    least, most = np.min(low, axis=0), np.max(high, axis=0)
    return {
        "torso_box": (0.5 * (most - least)).tolist(),
        "torso_centre": (0.5 * (most + least) + 0.0).tolist(),
    }


def _besides_foot(tibia: Body, foot: Array) -> list[tuple[Solid, float]]:
    """Returns the round solids of a tibia without the foot's sphere, and their places on the line
    from 0 at the joint to 1 at the foot.
    """
    length = float(foot @ foot)
    rounds = [solid for solid in _solids(tibia) if solid.kind != "box"]
    spheres = [solid for solid in rounds if solid.kind == "sphere"]
    outermost = max(spheres, key=lambda solid: float(solid.centre @ solid.centre), default=None)
    return [
        (solid, float(np.clip(solid.centre @ foot / length, 0.0, 1.0)) if length > 0.0 else 0.0)
        for solid in rounds
        if solid is not outermost
    ]
