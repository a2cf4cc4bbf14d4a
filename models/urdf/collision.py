"""Computes the spheres of torso, knees and shanks from a URDF's collision elements.

The torso's box encloses its boxes, cylinders, spheres and capsules, along the torso's axes. A
cylinder or capsule of the femur gives the radius at the knee. One of the tibia gives that of the
shank and its place on the line to the foot. Spheres of the tibia besides the foot's give the knee
near the joint, else the shank. All legs have the largest of their sizes. Meshes are not read.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.urdf.bodies import Body
from hexapod_cosim.models.urdf.elements import Solid

NEAR_KNEE = 0.25  # 1  of the way from the tibia's joint to the foot; spheres below it are the knee


def collision_body(
    torso: Body, origin_of_torso: Array, axes: Array, legs: list[tuple[Body, Body, Array]]
) -> dict[str, Any]:
    """Returns the keys of [body] that the collision elements give; empty without any.

    legs: femur, tibia and the foot's centre (3,) in the tibia's frame [m], of each leg.
    """
    table = _torso_box(torso, origin_of_torso, axes)
    knees, shanks = [], []
    for femur, tibia, foot in legs:
        knees += [solid.radius for solid in femur.solids if solid.kind in ("cylinder", "capsule")]
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
    for solid in torso.solids:
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
    rounds = [solid for solid in tibia.solids if solid.kind != "box"]
    spheres = [solid for solid in rounds if solid.kind == "sphere"]
    outermost = max(spheres, key=lambda solid: float(solid.centre @ solid.centre), default=None)
    return [
        (solid, float(np.clip(solid.centre @ foot / length, 0.0, 1.0)) if length > 0.0 else 0.0)
        for solid in rounds
        if solid is not outermost
    ]
