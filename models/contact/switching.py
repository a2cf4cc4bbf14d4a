"""Switches contacts at the ends of steps: touch-down and lift-off, plastic depth and footprints of
soil, and contacts that pass from one face of blocks to another.

The fast form is plant_fmu/src/contact_law.c and lanes/soil_path.h.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.bodies import pair_contacts, standing_pairs
from hexapod_cosim.models.contact.forces import (
    Candidate,
    Contacts,
    candidates,
    contacts_at,
    has_soil,
    open_contacts,
    own_ground,
    shares_of_feet,
    sphere_centre,
)
from hexapod_cosim.models.contact.geometry import FootContact
from hexapod_cosim.models.contact.law import ContactState, contact_damping
from hexapod_cosim.models.ground.blocks import Cell, cell_at, outside
from hexapod_cosim.models.ground.faces import blocks_of, surface_of
from hexapod_cosim.models.ground.surface import LAW, MU, MU_STATIC, STIFFNESS
from hexapod_cosim.models.kinematics import LEGS, foot_centres
from hexapod_cosim.models.method import deepest
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.soil.law import plastic_depth, row_soil, soil_radius
from hexapod_cosim.models.soil.presets import Soil

LEAST_FOOTPRINT = 1e-6  # m  shallower ones are not recorded
SAME_FACE = 1e-6  # m, 1  depth and normal of one contact at both sides of a border between cells
FAR = 1e3  # m  within its cell is a foot that has none


@dataclass(frozen=True)
class Depths:
    """Depths and approach speeds of all contacts, and how far feet have left their cells."""

    delta: Array  # (n,) m  of feet above the depth at which they touch soil; legs' pairs last
    ddelta: Array  # (n,) m/s
    outside: Array  # (6,) m  < 0: inside; -FAR: no cell is assigned


def depths_of(robot: Robot, body: Array, contacts: Contacts) -> Depths:
    """Returns the depths of all contacts at bodies (19, 13)."""
    found = [*contacts_at(robot, body, contacts), *pair_contacts(robot, body)]
    delta = np.array([contact.penetration for contact in found])
    delta[:LEGS] -= contacts.plastic
    far = np.full(LEGS, -FAR)
    surface = blocks_of(robot.terrain)
    if surface is not None:
        for leg, at in enumerate(foot_centres(robot, body)):
            cell = contacts.cell[leg]
            if cell is not None:
                far[leg] = outside(surface, float(at[0]), float(at[1]), cell)
    return Depths(delta, np.array([contact.approach_speed for contact in found]), far)


# touch-down and lift-off


def ground_under(robot: Robot, point: Candidate, centre: Array) -> ContactState:
    """Returns an open contact with the ground at a sphere's centre (3,), or with its patch.

    A patch with a kinetic coefficient of its own has no static rise unless it gives one.
    """
    surface, state = surface_of(robot.terrain), own_ground(robot, point)
    if surface is None or surface.materials is None:
        return state
    number = surface.material_at(float(centre[0]), float(centre[1]))
    if number == 0:
        return state
    row = surface.materials[number - 1]
    mu = state.friction.mu if math.isnan(row[MU]) else float(row[MU])
    fallback = state.friction.mu_static if math.isnan(row[MU]) else mu
    mu_static = fallback if math.isnan(row[MU_STATIC]) else float(row[MU_STATIC])
    stiffness = robot.contact.stiffness if math.isnan(row[STIFFNESS]) else float(row[STIFFNESS])
    return replace(
        state,
        friction=replace(state.friction, mu=mu, mu_static=mu_static),
        contact=replace(robot.contact, stiffness=stiffness),
        soil=row_soil(row[LAW:]) if point.is_sole else Soil(),
    )


def closed(robot: Robot, point: Candidate, body: Array, impact_speed: float) -> ContactState:
    """Returns the contact of a sphere that touches down at a speed [m/s], at bodies (19, 13)."""
    damping = contact_damping(robot.contact, impact_speed)
    state = ground_under(robot, point, sphere_centre(point, body))
    return replace(state, damping=damping, impact_speed=impact_speed)


def start_contacts(robot: Robot, body: Array) -> Contacts:
    """Returns the contacts of bodies (19, 13) at the start: spheres in the ground are closed, with
    impact speed 0; those in soil have been pressed into it.
    """
    contacts = open_contacts(robot)
    depths = depths_of(robot, body, contacts)
    states, plastic = list(contacts.states), contacts.plastic.copy()
    for k, point in enumerate(candidates(robot)):
        if depths.delta[k] > 0.0:
            states[k] = closed(robot, point, body, 0.0)
            if states[k].is_soft:
                plastic[k] = plastic_depth(states[k].soil, robot.foot, float(depths.delta[k]))
    pairs = standing_pairs(robot, body)
    contacts = replace(contacts, states=tuple(states), plastic=plastic, pairs=pairs)
    return assign_cells(robot, body, contacts)


def assign_cells(robot: Robot, body: Array, contacts: Contacts) -> Contacts:
    """Holds the cells of feet that touch blocks, and releases those of others."""
    surface = blocks_of(robot.terrain)
    if surface is None:
        return contacts
    states = zip(candidates(robot), contacts.states, strict=True)
    in_contact = {point.leg for point, state in states if not state.is_open}
    cells: list[Cell | None] = []
    for leg, at in enumerate(foot_centres(robot, body)):
        below = cell_at(surface, float(at[0]), float(at[1]))
        cells.append((contacts.cell[leg] or below) if leg in in_contact else None)
    return replace(contacts, cell=tuple(cells))


def switch_contacts(
    robot: Robot, body: Array, contacts: Contacts, depths: Depths
) -> tuple[Contacts, int]:
    """Closes spheres that are in the ground and opens those that are not.

    Returns the contacts and the number of touch-downs.
    """
    delta = depths.delta
    if has_soil(robot):
        contacts, delta = update_footprints(robot, body, contacts, delta)
    states, touchdowns = list(contacts.states), 0
    walls = blocks_of(robot.terrain) is not None
    found = contacts_at(robot, body, contacts) if walls else []
    for k, point in enumerate(candidates(robot)):
        if states[k].is_open and delta[k] > 0.0:
            now = closed(robot, point, body, float(depths.ddelta[k]))
            states[k] = _continued(robot, contacts, k, found, now) if walls else now
            touchdowns += 1
        elif not states[k].is_open and delta[k] <= 0.0:
            states[k] = replace(states[k], damping=math.nan)
    pairs = switched_pairs(robot, contacts, depths)
    touchdowns += sum(
        before.is_open and not now.is_open
        for before, now in zip(contacts.pairs, pairs, strict=True)
    )
    contacts = replace(contacts, pairs=pairs)
    if all(now is before for now, before in zip(states, contacts.states, strict=True)):
        return contacts, touchdowns
    return assign_cells(robot, body, replace(contacts, states=tuple(states))), touchdowns


def switched_pairs(robot: Robot, contacts: Contacts, depths: Depths) -> tuple[ContactState, ...]:
    """Returns the contacts between legs, closed where they overlap and open elsewhere."""
    found, first = [], len(contacts.states)
    for k, state in enumerate(contacts.pairs):
        depth, speed = float(depths.delta[first + k]), float(depths.ddelta[first + k])
        if state.is_open and depth > 0.0:
            damping = contact_damping(robot.contact, speed)
            found.append(replace(state, damping=damping, impact_speed=speed))
        else:
            found.append(state if depth > 0.0 else replace(state, damping=math.nan))
    return tuple(found)


def _continued(
    robot: Robot, contacts: Contacts, number: int, found: list[FootContact], now: ContactState
) -> ContactState:
    """Returns a contact that closes, with the impact of one that carries the same part of the foot.

    A step that is lower than a foot is deep causes no impact of its own.
    """
    point, depth, result = candidates(robot)[number], 0.0, now
    for j, (other, state) in enumerate(zip(candidates(robot), contacts.states, strict=True)):
        if point.leg < 0 or other.leg != point.leg or state.is_open:
            continue
        turn = float(np.sum((found[j].normal - found[number].normal) ** 2))
        near = turn * robot.foot.radius <= 4.0 * found[j].penetration
        if near and found[j].penetration > depth:
            depth = found[j].penetration
            result = replace(now, damping=state.damping, impact_speed=state.impact_speed)
    return result


# soil


def footprint_depth(footprints: Array, centre: Array) -> float:
    """Returns the depth [m] of the deepest footprint around a point; 0 outside of all."""
    away = np.hypot(footprints[:, 0] - centre[0], footprints[:, 1] - centre[1])
    inside = footprints[away <= footprints[:, 3]]
    return float(np.max(inside[:, 2], initial=0.0))


def yield_soil(robot: Robot, contacts: Contacts, h: float, before: Depths, after: Depths) -> Array:
    """Returns the plastic depths (6,) of feet [m] at the end of a step of h [s] (eq. 44).

    They follow from the largest depths between the steps' ends. before, after: at the ends, with
    the plastic depths of the step.
    """
    plastic = contacts.plastic.copy()
    for leg, state in enumerate(contacts.states[:LEGS]):
        if state.is_open or not state.is_soft:
            continue
        from_, to = (float(ends.delta[leg] + plastic[leg]) for ends in (before, after))
        slopes = (h * float(before.ddelta[leg]), h * float(after.ddelta[leg]))
        depth = deepest(from_, slopes[0], to, slopes[1])
        plastic[leg] = max(plastic[leg], plastic_depth(state.soil, robot.foot, depth))
    return plastic


def update_footprints(
    robot: Robot, body: Array, contacts: Contacts, delta: Array
) -> tuple[Contacts, Array]:
    """Records the footprints that feet leave upwards, and finds those entered from above.

    An open foot below the undisturbed surface is above its footprint, whose bottom it may touch
    again; the footprint is complete when the foot has left it upwards. Rigid ground beside a
    footprint has none. Depths (n,) follow the plastic depths to which they refer.
    """
    delta, plastic, place = delta.copy(), contacts.plastic.copy(), contacts.place.copy()
    footprints = contacts.footprints
    for leg, point in enumerate(candidates(robot)[:LEGS]):
        z, centre = delta[leg] + plastic[leg], sphere_centre(point, body)
        if not contacts.states[leg].is_open:
            if delta[leg] <= 0.0:
                place[leg] = centre[:2]
            continue
        if z <= 0.0:
            if plastic[leg] >= LEAST_FOOTPRINT:
                new = [*place[leg], plastic[leg], soil_radius(robot.foot)]
                footprints = np.vstack([footprints, new])
            plastic[leg] = 0.0
        elif plastic[leg] == 0.0 and ground_under(robot, point, centre).is_soft:
            plastic[leg] = footprint_depth(footprints, centre)
        delta[leg] = z - plastic[leg]
    return replace(contacts, plastic=plastic, place=place, footprints=footprints), delta


# blocks


def cross_cells(robot: Robot, body: Array, contacts: Contacts, depths: Depths) -> Contacts:
    """Hands the contacts of feet that have left their cells over to the faces around the new cells.

    A contact continues in the face that has its depth and its normal, without a touch-down.
    """
    surface = surface_of(robot.terrain)
    gone = [leg for leg in range(LEGS) if depths.outside[leg] > 0.0]
    if surface is None or not gone:
        return contacts
    cells = list(contacts.cell)
    for leg in gone:
        cells[leg] = cell_at(surface, *foot_centres(robot, body)[leg, :2].tolist())
    moved = replace(contacts, cell=tuple(cells))
    before, after = contacts_at(robot, body, contacts), contacts_at(robot, body, moved)
    closed = [j for j, state in enumerate(contacts.states) if not state.is_open]
    placed = [(candidates(robot)[j], contacts.states[j], before[j]) for j in closed]
    share = dict(zip(closed, shares_of_feet(robot, placed).tolist(), strict=True))
    feet, states = candidates(robot), list(contacts.states)
    for k, point in enumerate(feet):
        if point.leg not in gone:
            continue
        states[k], largest = replace(contacts.states[k], damping=math.nan), -1.0
        for j, other in enumerate(feet):
            same = other.leg == point.leg and is_same_face(before[j], after[k])
            if same and j in share and share[j] > largest:
                largest = share[j]
                states[k] = continued_state(contacts.states[j], other, point, states[k])
    return replace(moved, states=tuple(states))


def is_same_face(a: FootContact, b: FootContact) -> bool:
    """Returns whether two contacts of a foot are with the same face: one depth and normal."""
    turn = float(np.sum((a.normal - b.normal) ** 2))
    return abs(a.penetration - b.penetration) < SAME_FACE and turn < SAME_FACE


def continued_state(
    old: ContactState, from_: Candidate, to: Candidate, before: ContactState
) -> ContactState:
    """Returns a contact that continues in another face. Bristles are those of soles."""
    if from_.is_sole and to.is_sole:
        return old
    return replace(old, friction=replace(old.friction, law=before.friction.law))
