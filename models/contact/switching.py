"""Switches contacts at the ends of steps: touch-down and lift-off, plastic depth and footprints of
soil, and contacts that pass from one face of blocks to another.

The fast form is plant_fmu/src/contact_law.c and lanes/soil_path.h.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.footprints import (
    LEAST_FOOTPRINT,
    deepest,
    footprint_depth,
    place_of_footprint,
)
from hexapod_cosim.models.contact.forces import (
    Candidate,
    Contacts,
    ContactState,
    candidates,
    contacts_at,
    has_soil,
    open_contacts,
    own_ground,
    shares_of_feet,
    soil_for,
    sphere_centre,
    standing_pairs,
)
from hexapod_cosim.models.contact.geometry import FootContact
from hexapod_cosim.models.contact.law import contact_damping
from hexapod_cosim.models.contact.pairs import pair_contacts
from hexapod_cosim.models.contact.spheres import side_on_ground
from hexapod_cosim.models.ground.blocks import Cell, cell_at, depth_around, is_uneven, outside
from hexapod_cosim.models.ground.faces import surface_of
from hexapod_cosim.models.ground.surface import LAW, MU, MU_STATIC, STIFFNESS
from hexapod_cosim.models.kinematics import LEGS, foot_centres
from hexapod_cosim.models.records import Robot, Soil
from hexapod_cosim.models.soil.law import plastic_depth, row_soil, soil_radius

SAME_FACE = 1e-6  # m, 1  depth and normal of one contact at both sides of a border between cells
FAR = 1e3  # m  within its cell is a foot that has none or keeps it


@dataclass(frozen=True)
class Depths:
    """Depths and approach speeds of all contacts, and how far feet have left their cells."""

    delta: Array  # (n,) m  above the depth at which spheres touch soil; legs' pairs last
    ddelta: Array  # (n,) m/s
    outside: Array  # (6,) m  < 0: inside; -FAR: no cell is assigned, or it is kept


def has_cells(robot: Robot) -> bool:
    """Returns whether the ground consists of blocks."""
    surface = surface_of(robot.terrain)
    return surface is not None and surface.kind == "blocks"


def depths_of(robot: Robot, body: Array, contacts: Contacts) -> Depths:
    """Returns the depths of all contacts at bodies (19, 13)."""
    found = [*contacts_at(robot, body, contacts), *pair_contacts(robot, body)]
    delta = np.array([contact.penetration for contact in found])
    delta[: len(contacts.soil_depth)] -= contacts.soil_depth
    far = np.full(LEGS, -FAR)
    surface = surface_of(robot.terrain)
    if surface is not None and has_cells(robot):
        for leg, at in enumerate(foot_centres(robot, body)):
            cell = contacts.cell[leg]
            way = -FAR if cell is None else outside(surface, float(at[0]), float(at[1]), cell)
            far[leg] = -FAR if way > 0.0 and keeps_cell(robot, contacts, leg, at) else way
    return Depths(delta, np.array([contact.approach_speed for contact in found]), far)


def keeps_cell(robot: Robot, contacts: Contacts, leg: int, at: Array) -> bool:
    """Returns whether a foot that was dragged off its block in soil keeps it. at: centre of the
    foot (3,) [m].

    It may have passed through other blocks, and no face may begin at a depth: it does not change to
    a block in whose faces it is deeper than in those around its own. In soil or above the bottom of
    its footprint it changes to a level block beside its own alone.
    """
    state, own = contacts.states[leg], contacts.cell[leg]
    surface = surface_of(robot.terrain)
    if own is None or surface is None or not has_soil(robot):
        return False
    in_footprint = contacts.soil_depth[leg] > 0.0 or (state.is_soft and not state.is_open)
    below = cell_at(surface, float(at[0]), float(at[1]))
    is_near = max(abs(below[0] - own[0]), abs(below[1] - own[1])) <= 1
    if in_footprint and not (is_near and surface.height[below] == surface.height[own]):
        return True
    above, radius = at - np.array([0.0, 0.0, robot.terrain.height]), robot.foot.radius
    new, old = (
        depth_around(surface, above, radius, cell, with_top=not in_footprint)
        for cell in (below, own)
    )
    return new > old + SAME_FACE


def has_contact(robot: Robot, contacts: Contacts, leg: int) -> bool:
    """Returns whether a foot has a contact."""
    return any(
        point.leg == leg and not state.is_open
        for point, state in zip(candidates(robot), contacts.states, strict=True)
    )


def is_inside_blocks(robot: Robot, contacts: Contacts, leg: int, at: Array) -> bool:
    """Returns whether a foot that holds a block of soil is in the faces around another one.
    Released there, it would meet them at a depth. at: centre of the foot (3,) [m].
    """
    own, surface = contacts.cell[leg], surface_of(robot.terrain)
    if own is None or surface is None or not has_soil(robot):
        return False
    below = cell_at(surface, float(at[0]), float(at[1]))
    above = at - np.array([0.0, 0.0, robot.terrain.height])
    radius = robot.foot.radius
    return below != own and depth_around(surface, above, radius, below, with_top=True) > 0.0


# touch-down and lift-off


def ground_under(robot: Robot, point: Candidate, centre: Array, side: int = 2) -> ContactState:
    """Returns an open contact with the ground at a sphere's centre (3,), or with its patch.

    side: axis of the torso whose side faces the ground.

    A patch with a kinetic coefficient of its own has no static rise unless it gives one. Walls are
    rigid, of the patch's friction, and for torso, knees and shanks blocks with edges.
    """
    surface = surface_of(robot.terrain)
    x, y = float(centre[0]), float(centre[1])
    sinks = point.leg >= 0 or surface is None or not is_uneven(surface, x, y)
    own = soil_for(robot.soil, robot, point, side) if sinks else Soil()
    state = replace(own_ground(robot, point), soil=own, side=side)
    if surface is None or surface.materials is None:
        return state
    number = surface.material_at(x, y)
    if number == 0:
        return state
    row = surface.materials[number - 1]
    # a row with a kinetic coefficient alone has no higher static one
    mu = state.friction.mu if math.isnan(row[MU]) else float(row[MU])
    fallback = state.friction.mu_static if math.isnan(row[MU]) else mu
    mu_static = fallback if math.isnan(row[MU_STATIC]) else float(row[MU_STATIC])
    stiffness = robot.contact.stiffness if math.isnan(row[STIFFNESS]) else float(row[STIFFNESS])
    return replace(
        state,
        friction=replace(state.friction, mu=mu, mu_static=mu_static),
        contact=replace(robot.contact, stiffness=stiffness),
        soil=soil_for(row_soil(row[LAW:]), robot, point, side) if sinks else Soil(),
    )


def closed(robot: Robot, point: Candidate, body: Array, impact_speed: float) -> ContactState:
    """Returns the contact of a sphere that touches down at a speed [m/s], at bodies (19, 13)."""
    sphere, damping = point.sphere, contact_damping(robot.contact, impact_speed)
    side = side_on_ground(robot, sphere, body[sphere.body]) if sphere.pads else 2
    state = ground_under(robot, point, sphere_centre(point, body), side)
    return replace(state, damping=damping, impact_speed=impact_speed)


def start_contacts(robot: Robot, body: Array) -> Contacts:
    """Returns the contacts of bodies (19, 13) at the start: spheres in the ground are closed, with
    impact speed 0; those in soil have been pressed into it.
    """
    contacts = open_contacts(robot)
    depths = depths_of(robot, body, contacts)
    states, soil_depth = list(contacts.states), contacts.soil_depth.copy()
    for k, point in enumerate(candidates(robot)):
        if depths.delta[k] > 0.0:
            states[k] = closed(robot, point, body, 0.0)
            if states[k].is_soft:
                depth = float(depths.delta[k])
                soil_depth[k] = plastic_depth(
                    states[k].soil, point.shape(robot, states[k].side), depth
                )
    pairs = standing_pairs(robot, body)
    contacts = replace(contacts, states=tuple(states), soil_depth=soil_depth, pairs=pairs)
    return assign_cells(robot, body, contacts)


def assign_cells(robot: Robot, body: Array, contacts: Contacts) -> Contacts:
    """Holds the cells of feet that touch blocks, are in their footprints or in other blocks, and
    releases those of others.
    """
    surface = surface_of(robot.terrain)
    if surface is None or not has_cells(robot):
        return contacts
    cells: list[Cell | None] = []
    for leg, at in enumerate(foot_centres(robot, body)):
        holds = (
            contacts.soil_depth[leg] > 0.0
            or has_contact(robot, contacts, leg)
            or is_inside_blocks(robot, contacts, leg, at)
        )
        below = cell_at(surface, float(at[0]), float(at[1]))
        cells.append((contacts.cell[leg] or below) if holds else None)
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
        contacts = assign_cells(robot, body, contacts)
    states, touchdowns = list(contacts.states), 0
    walls = has_cells(robot)
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


def yield_soil(robot: Robot, contacts: Contacts, h: float, before: Depths, after: Depths) -> Array:
    """Returns the plastic depths (n,) of all spheres [m] at the end of a step of h [s] (eq. 44).

    They follow from the largest depths between the steps' ends. before, after: at the ends, with
    the plastic depths of the step.
    """
    soil_depth = contacts.soil_depth.copy()
    for k, (point, state) in enumerate(zip(candidates(robot), contacts.states, strict=True)):
        if state.is_open or not state.is_soft:
            continue
        from_, to = (float(ends.delta[k] + soil_depth[k]) for ends in (before, after))
        slopes = (h * float(before.ddelta[k]), h * float(after.ddelta[k]))
        depth = deepest(from_, slopes[0], to, slopes[1])
        shape = point.shape(robot, state.side)
        soil_depth[k] = max(soil_depth[k], plastic_depth(state.soil, shape, depth))
    return soil_depth


def update_footprints(
    robot: Robot, body: Array, contacts: Contacts, delta: Array
) -> tuple[Contacts, Array]:
    """Records the footprints that spheres leave upwards, and finds those entered from above.

    An open sphere below the undisturbed surface is above its footprint, whose bottom it may touch
    again; the footprint is complete when the sphere has left it upwards. Rigid ground beside a
    footprint has none. Depths (n,) follow the plastic depths to which they refer.
    """
    delta, soil_depth, place = delta.copy(), contacts.soil_depth.copy(), contacts.place.copy()
    footprints = contacts.footprints
    for k, point in _in_plant_order(robot):
        z, state, centre = (
            delta[k] + soil_depth[k],
            contacts.states[k],
            sphere_centre(point, body),
        )
        if not state.is_open:
            if delta[k] <= 0.0:
                place[k] = place_of_footprint(robot, contacts, point, centre)
            continue
        if z <= 0.0:
            if soil_depth[k] >= LEAST_FOOTPRINT:
                new = [*place[k], soil_depth[k], soil_radius(point.shape(robot, state.side))]
                footprints = np.vstack([footprints, new])
            soil_depth[k] = 0.0
        elif soil_depth[k] == 0.0 and ground_under(robot, point, centre).is_soft:
            soil_depth[k] = footprint_depth(footprints, centre, surface_of(robot.terrain))
        delta[k] = z - soil_depth[k]
    return replace(contacts, soil_depth=soil_depth, place=place, footprints=footprints), delta


def _in_plant_order(robot: Robot) -> list[tuple[int, Candidate]]:
    """Returns the spheres that may sink with their numbers, in the order in which the C plant
    looks at them: feet, knees, shanks, corners of the torso.
    """
    spheres = [(k, point) for k, point in enumerate(candidates(robot)) if point.may_sink]
    return sorted(spheres, key=lambda numbered: numbered[1].sphere.name == "torso")


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
        x, y, _ = foot_centres(robot, body)[leg].tolist()
        cells[leg] = cell_at(surface, x, y)
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
    """Returns a contact that continues in another face. Bristles and soil are those of soles."""
    if from_.is_sole and to.is_sole:
        return old
    law = before.friction.law
    static = replace(old.friction, law=law)
    return replace(old, friction=static, soil=Soil())
