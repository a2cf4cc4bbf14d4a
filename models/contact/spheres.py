"""Computes contacts of torso, knees and shanks with the ground.

Each is a sphere with the normal law of the feet (eq. 14) and the friction of the tanh law (eq. 15),
also where the feet have bristles. The torso has eight, around the corners of a box. Soil is rigid
ground for them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import (
    FootContact,
    foot_force,
    resting_damping,
    sphere_contact,
)
from hexapod_cosim.models.friction import Friction
from hexapod_cosim.models.ground.faces import ground
from hexapod_cosim.models.kinematics import JOINTS, LEGS, rotation_matrix
from hexapod_cosim.models.records import Robot


@dataclass(frozen=True)
class BodySphere:
    """A sphere of a body that may touch the ground."""

    name: str  # torso, LF.knee, LF.shank, ...
    body: int  # number of the body
    centre: Array  # (3,) from the body's centre of mass, body axes [m]
    radius: float  # m


def body_spheres(robot: Robot) -> tuple[BodySphere, ...]:
    """Returns the spheres of torso, knees and shanks; none without contact of the body.

    The order is that of the C plant: the torso's corners, of which bit i of the number chooses the
    side along axis i, then the knees, then the shanks.
    """
    body = robot.body
    if body.contact == "off":
        return ()
    spheres = []
    if any(body.torso_box):
        offset = np.subtract(body.torso_centre, robot.torso.com)
        for z, y, x in product((-1.0, 1.0), repeat=3):
            corner = offset + np.array([x, y, z]) * body.torso_box
            spheres.append(BodySphere("torso", 0, corner, body.corner_radius))
    for name, radius, share in (
        ("knee", body.knee_radius, 0.0),
        ("shank", body.shank_radius, body.shank_position),
    ):
        for leg in range(LEGS if radius > 0.0 else 0):
            tibia = robot.legs[leg].links[-1]
            centre = share * np.array(tibia.tip) - np.array(tibia.com)
            label = f"{robot.legs[leg].name}.{name}"
            spheres.append(BodySphere(label, JOINTS * (leg + 1), centre, radius))
    return tuple(spheres)


def body_contact(robot: Robot, sphere: BodySphere, state: Array) -> FootContact:
    """Returns the contact of a sphere with the nearest face of the ground.

    state: (13,) of the sphere's body.
    """
    centre = state[0:3] + rotation_matrix(state[3:7]) @ sphere.centre
    return sphere_contact(state, centre, sphere.radius, ground(robot.terrain, centre))


def body_contacts(robot: Robot, body: Array) -> tuple[FootContact, ...]:
    """Returns the contacts of all spheres of `body_spheres`, at bodies (19, 13)."""
    return tuple(body_contact(robot, sphere, body[sphere.body]) for sphere in body_spheres(robot))


def standing_body_damping(robot: Robot, body: Array) -> Array:
    """Returns the damping of all spheres [s/m] at impact speed 0; nan for those above the
    ground.
    """
    return resting_damping(robot.contact, body_contacts(robot, body))


def sliding_friction_of_bodies(friction: Friction) -> Friction:
    """Returns the tanh law (eq. 35) in place of bristles, which bodies do not have."""
    return replace(friction, law="tanh") if friction.has_bristles else friction


def body_forces(robot: Robot, body: Array, damping: Array) -> Array:
    """Returns the forces (n, 3) of the ground on all spheres [N].

    damping: (n,) of the contacts [s/m], nan for open ones.
    """
    smooth = replace(robot, friction=sliding_friction_of_bodies(robot.friction))
    forces = [
        foot_force(smooth, contact, float(d))
        for contact, d in zip(body_contacts(robot, body), damping, strict=True)
    ]
    return np.array(forces).reshape(-1, 3)
