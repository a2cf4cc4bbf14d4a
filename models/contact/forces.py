"""Computes the forces of all contacts with any ground, and defines their state.

A foot touches the ground below it and, on blocks, up to three higher blocks beside it; torso, knees
and shanks are the spheres of bodies.py. A closed contact keeps its damping (eq. 14) and the
ground on which it touched down: stiffness, friction or soil. Forces are those of rigid ground
(law.py) or of soil (soil/law.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.bodies import (
    BodySphere,
    body_contact,
    body_spheres,
    leg_pairs,
    open_body_contact,
    pair_contacts,
)
from hexapod_cosim.models.contact.geometry import (
    FootContact,
    contact_shares,
    slip_velocity,
    sphere_contact,
    turning_moment,
)
from hexapod_cosim.models.contact.law import ContactState, normal_force
from hexapod_cosim.models.friction import bristle_rate, friction_force
from hexapod_cosim.models.ground.blocks import TOP, Cell
from hexapod_cosim.models.ground.faces import faces_of_feet, ground_face, surface_of
from hexapod_cosim.models.kinematics import JOINTS, LEGS, cross, rotation_matrix
from hexapod_cosim.models.records import Foot, Robot
from hexapod_cosim.models.soil.law import shear_force, shear_limit, shear_rate, soil_normal_force

NEAREST = "nearest"  # face of torso, knees and shanks


@dataclass(frozen=True)
class Candidate:
    """A sphere and the face of the ground that it may touch."""

    sphere: BodySphere
    face: str  # of `faces_of_feet`, or NEAREST
    leg: int  # of feet; -1: of torso, knees and shanks

    @property
    def is_sole(self) -> bool:
        """Whether this is a foot on the ground below it, which has bristles."""
        return self.face == TOP


@dataclass(frozen=True)
class Contacts:
    """State of all contacts. It changes at the ends of steps alone."""

    states: tuple[ContactState, ...]  # in the order of `candidates`
    plastic: Array  # (6,) m  depth at which feet touch soil: z_p, or that of a footprint; else 0
    place: Array  # (6, 2) m  where they lost contact with the bottom of their footprints
    cell: tuple[Cell | None, ...]  # (6,) of blocks, assigned while a foot touches; None: none
    footprints: Array  # (n, 4) m  x, y, depth, radius
    pairs: tuple[ContactState, ...] = ()  # contacts between legs, in the order of `leg_pairs`

    @property
    def damping(self) -> Array:
        """Damping of all contacts, last those between legs, (n,) [s/m], nan for open ones."""
        return np.array([state.damping for state in (*self.states, *self.pairs)])

    @property
    def impact_speed(self) -> Array:
        """Approach speeds of all contacts at their last touch-downs (n,) [m/s]."""
        return np.array([state.impact_speed for state in (*self.states, *self.pairs)])


def candidates(robot: Robot) -> tuple[Candidate, ...]:
    """Returns all contacts: feet face by face, their soles first, then torso, knees and shanks."""
    feet = []
    for face in faces_of_feet(robot.terrain):
        for leg in range(LEGS):
            tibia = robot.legs[leg].links[-1]
            centre = np.array(tibia.tip) - np.array(tibia.com)
            name = f"{robot.legs[leg].name}.foot"
            sphere = BodySphere(name, JOINTS * (leg + 1), centre, robot.foot.radius)
            feet.append(Candidate(sphere, face, leg))
    return (*feet, *(Candidate(sphere, NEAREST, -1) for sphere in body_spheres(robot)))


def own_ground(robot: Robot, point: Candidate) -> ContactState:
    """Returns an open contact with the ground of the robot file, without the surface's patches."""
    if not point.is_sole:  # bristles and soil are those of soles alone
        return open_body_contact(robot)
    return ContactState(robot.contact, robot.friction, robot.soil)


def open_contacts(robot: Robot) -> Contacts:
    """Returns the contacts of a robot in the air, over undisturbed ground."""
    states = tuple(own_ground(robot, point) for point in candidates(robot))
    pairs = (open_body_contact(robot),) * len(leg_pairs(robot))
    nothing = np.zeros(LEGS), np.zeros((LEGS, 2)), (None,) * LEGS, np.zeros((0, 4))
    return Contacts(states, *nothing, pairs)


def contacts_of(robot: Robot, damping: Array, body_damping: Array | None = None) -> Contacts:
    """Returns contacts with these dampings [s/m] on the robot's own ground; nan: open.

    damping: (6,) of the soles; contacts with walls are open. body_damping: of torso, knees and
    shanks, in the order of `body_spheres`; None: open.
    """
    contacts = open_contacts(robot)
    walls = len(contacts.states) - len(body_spheres(robot)) - LEGS
    bodies = np.full(len(body_spheres(robot)), math.nan) if body_damping is None else body_damping
    given = np.concatenate([damping, np.full(walls, math.nan), bodies])
    pairs = zip(contacts.states, given.tolist(), strict=True)
    return replace(contacts, states=tuple(replace(state, damping=d) for state, d in pairs))


def sphere_centre(point: Candidate, body: Array) -> Array:
    """Returns the centre (3,) [m] of a contact's sphere at bodies (19, 13)."""
    carrier = body[point.sphere.body]
    R_WB, centre_B = rotation_matrix(carrier[3:7]), point.sphere.centre
    return np.asarray(carrier[0:3] + R_WB @ centre_B)


def contact_at(
    robot: Robot, point: Candidate, body: Array, cell: Cell | None = None
) -> FootContact:
    """Returns the kinematics of a contact at bodies (19, 13).

    cell: of blocks, assigned to a foot. The contact of a wall that is not there is infinitely far.
    """
    carrier = body[point.sphere.body]
    if point.leg < 0:
        return body_contact(robot, point.sphere, carrier)
    centre = sphere_centre(point, body)
    face = ground_face(robot.terrain, centre, point.face, cell)
    far = FootContact(centre, np.zeros(3), np.array([0.0, 0.0, 1.0]), -math.inf, 0.0)
    return far if face is None else sphere_contact(carrier, centre, point.sphere.radius, face)


def contacts_at(robot: Robot, body: Array, contacts: Contacts) -> list[FootContact]:
    """Returns the kinematics of all contacts at bodies (19, 13)."""
    return [
        contact_at(robot, point, body, contacts.cell[point.leg] if point.leg >= 0 else None)
        for point in candidates(robot)
    ]


def closed_contacts(
    robot: Robot, body: Array, contacts: Contacts
) -> list[tuple[int, Candidate, ContactState, FootContact]]:
    """Returns number, point, state and kinematics of the closed contacts.

    The stiffness of feet is multiplied by the shares of their contacts (`contact_shares`), which
    are 1 but on blocks.
    """
    found = []
    for k, (point, state) in enumerate(zip(candidates(robot), contacts.states, strict=True)):
        if not state.is_open:
            cell = contacts.cell[point.leg] if point.leg >= 0 else None
            found.append((k, point, state, contact_at(robot, point, body, cell)))
    shares = shares_of_feet(robot, [(point, state, contact) for _, point, state, contact in found])
    return [
        (k, point, _with_share(state, share), contact)
        for (k, point, state, contact), share in zip(found, shares.tolist(), strict=True)
    ]


def shares_of_feet(robot: Robot, found: list[tuple[Candidate, ContactState, FootContact]]) -> Array:
    """Returns the shares (n,) of contacts in the force on their foot; 1 for others than feet."""
    shares = np.ones(len(found))
    if len(faces_of_feet(robot.terrain)) == 1:
        return shares
    for leg in range(LEGS):
        places = [
            place
            for place, (point, _, contact) in enumerate(found)
            if point.leg == leg and contact.penetration > 0.0
        ]
        depth = np.array([found[place][2].penetration for place in places])
        normal = np.array([found[place][2].normal for place in places])
        shares[places] = contact_shares(depth, normal, robot.foot.radius)
    return shares


def _with_share(state: ContactState, share: float) -> ContactState:
    """Returns a contact whose stiffness is multiplied by a share."""
    if share == 1.0:
        return state
    return replace(state, contact=replace(state.contact, stiffness=share * state.contact.stiffness))


# forces


def contact_load(
    foot: Foot, state: ContactState, plastic: float, depth: float, approach_speed: float
) -> float:
    """Returns f_n [N] of a closed contact at a depth [m] and an approach speed [m/s] (eq. 14, 45).

    plastic: z_p on soil [m].
    """
    if state.is_soft:
        return soil_normal_force(state.soil, foot, plastic, depth, approach_speed)
    return normal_force(state.contact, state.damping, depth, approach_speed)


def contact_force(
    foot: Foot, state: ContactState, plastic: float, contact: FootContact, bristle: Array | None
) -> Array:
    """Returns the force (3,) of the ground on a sphere [N].

    bristle: deflection (3,) of a sole [m]. On soil the depth of shear is not below z_p, so that a
    foot that leaves the ground within a step keeps its grip to the end of the step.
    """
    depth = contact.penetration
    load = contact_load(foot, state, plastic, depth, contact.approach_speed)
    if state.is_soft:
        limit = shear_limit(state.soil, foot, max(depth, plastic), load)
        sideways = shear_force(state.soil, limit, np.zeros(3) if bristle is None else bristle)
    else:
        sideways = friction_force(state.friction, load, slip_velocity(contact), bristle)
    return load * contact.normal + sideways


def contact_wrenches(
    robot: Robot, body: Array, contacts: Contacts, bristle: Array | None = None
) -> Array:
    """Returns forces and torques (19, 6) of all contacts on the bodies (19, 13) [N, N m].

    Torques are about the centres of mass. bristle: deflections (6, 3) [m], 0 by default.
    """
    g = np.zeros((len(body), 6))
    for k, point, state, contact in closed_contacts(robot, body, contacts):
        carrier = body[point.sphere.body]
        plastic = float(contacts.plastic[k]) if state.is_soft else 0.0
        deflection = bristle[point.leg] if bristle is not None and point.is_sole else None
        force = contact_force(robot.foot, state, plastic, contact, deflection)
        torque = cross(contact.point - carrier[0:3], force)
        if point.leg >= 0:
            depth, speed = contact.penetration, contact.approach_speed
            load = contact_load(robot.foot, state, plastic, depth, speed)
            friction, radius = state.friction, robot.foot.radius
            torque += turning_moment(friction, radius, load, contact.normal, carrier[10:13])
        g[point.sphere.body] += np.concatenate([force, torque])
    return g + pair_wrenches(robot, body, contacts)


def pair_wrenches(robot: Robot, body: Array, contacts: Contacts) -> Array:
    """Returns forces and torques (19, 6) of legs on each other [N, N m] (eq. 56)."""
    g = np.zeros((len(body), 6))
    if all(state.is_open for state in contacts.pairs):
        return g
    found = pair_contacts(robot, body)
    for pair, state, contact in zip(leg_pairs(robot), contacts.pairs, found, strict=True):
        if state.is_open:
            continue
        force = contact_force(robot.foot, state, 0.0, contact, None)
        for number, sign in ((pair.body, 1.0), (pair.other_body, -1.0)):
            torque = cross(contact.point - body[number, 0:3], force)
            g[number] += sign * np.concatenate([force, torque])
    return g


def contact_bristle_rate(state: ContactState, contact: FootContact, bristle: Array) -> Array:
    """Returns db/dt (3,) [m/s] of a closed sole (eq. 16, 36, 47); 0 without bristles."""
    slip = slip_velocity(contact)
    if state.is_soft:
        return shear_rate(state.soil, slip, bristle)
    return bristle_rate(state.friction, slip, bristle)


def has_soil(robot: Robot) -> bool:
    """Returns whether the ground may be soil, of the robot file or of a patch."""
    return bristle_length_of_patches(robot) > 0.0 or robot.soil.law != "none"


def bristle_length_of_patches(robot: Robot) -> float:
    """Returns the least shear displacement [m] of the soils of patches; 0: none."""
    surface = surface_of(robot.terrain)
    if surface is None or surface.materials is None:
        return 0.0
    lengths = [float(row[9]) for row in surface.materials if row[3] != 0.0]
    return min(lengths, default=0.0)


def bristle_length(robot: Robot) -> float:
    """Returns the length [m] by which errors of bristles are measured; 0 without bristles."""
    if robot.soil.law != "none":
        return robot.soil.shear_displacement
    if robot.friction.has_bristles:
        return robot.friction.presliding
    return bristle_length_of_patches(robot)
