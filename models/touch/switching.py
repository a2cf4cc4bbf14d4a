"""Switches contacts at the ends of steps: touch-down and lift-off, plastic depth and footprints of
soil, and contacts that pass from one face of blocks to another.

The fast form is plant_fmu/src/contact_law.c and lanes/soil_path.h.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hexapod_cosim.models.body.contacts import side_on_ground
from hexapod_cosim.models.body.pairs import pair_contacts
from hexapod_cosim.models.contact import FootContact, contact_damping
from hexapod_cosim.models.ground.blocks import Cell, cell_at, depth_around, is_uneven, outside
from hexapod_cosim.models.ground.surface import LAW, MU, MU_STATIC, STIFFNESS
from hexapod_cosim.models.kinematics import LEGS, foot_centres
from hexapod_cosim.models.records import Array, Robot, Soil
from hexapod_cosim.models.soil.law import plastic_depth, row_soil, soil_radius
from hexapod_cosim.models.terrain import surface_of
from hexapod_cosim.models.touch.forces import (
    Contacts,
    Held,
    Spot,
    contacts_at,
    has_soil,
    open_contacts,
    own_ground,
    shares_of_feet,
    soil_for,
    sphere_centre,
    spots,
    standing_pairs,
)
from hexapod_cosim.models.touch.prints import (
    LEAST_FOOTPRINT,
    deepest,
    footprint_depth,
    place_of_print,
)

SAME_FACE = 1e-6  # m, 1  depth and normal of one contact at both sides of a border between cells
FAR = 1e3  # m  within its cell is a foot that has none or keeps it


@dataclass(frozen=True)
class Depths:
    """Depths and approach speeds of all contacts, and how far feet have left their cells."""

    delta: Array  # (n,) m  above the depth at which spheres touch soil; legs' pairs last
    ddelta: Array  # (n,) m/s
    outside: Array  # (6,) m  < 0: inside; -FAR: no cell is held, or it is kept


def has_cells(robot: Robot) -> bool:
    """Returns whether the ground consists of blocks."""
    surface = surface_of(robot.terrain)
    return surface is not None and surface.kind == "blocks"


def depths_of(robot: Robot, body: Array, contacts: Contacts) -> Depths:
    """Returns the depths of all contacts at bodies (19, 13)."""
    found = [*contacts_at(robot, body, contacts), *pair_contacts(robot, body)]
    delta = np.array([contact.penetration for contact in found])
    delta[: len(contacts.sunk)] -= contacts.sunk
    far = np.full(LEGS, -FAR)
    surface = surface_of(robot.terrain)
    if surface is not None and has_cells(robot):
        for leg, at in enumerate(foot_centres(robot, body)):
            cell = contacts.cell[leg]
            way = -FAR if cell is None else outside(surface, float(at[0]), float(at[1]), cell)
            far[leg] = -FAR if way > 0.0 and keeps_block(robot, contacts, leg, at) else way
    return Depths(delta, np.array([contact.approach_speed for contact in found]), far)


def keeps_block(robot: Robot, contacts: Contacts, leg: int, at: Array) -> bool:
    """Returns whether a foot that was dragged off its block in soil keeps it. at: centre of the
    foot (3,) [m].

    It may have passed through other blocks, and no face may begin at a depth: it does not change to
    a block in whose faces it is deeper than in those around its own. In soil or above the bottom of
    its print it changes to a level block beside its own alone.
    """
    held, own = contacts.held[leg], contacts.cell[leg]
    surface = surface_of(robot.terrain)
    if own is None or surface is None or not has_soil(robot):
        return False
    in_print = contacts.sunk[leg] > 0.0 or (held.is_soft and not held.is_open)
    below = cell_at(surface, float(at[0]), float(at[1]))
    is_near = max(abs(below[0] - own[0]), abs(below[1] - own[1])) <= 1
    if in_print and not (is_near and surface.height[below] == surface.height[own]):
        return True
    above, radius = at - np.array([0.0, 0.0, robot.terrain.height]), robot.foot.radius
    new, old = (
        depth_around(surface, above, radius, cell, with_top=not in_print) for cell in (below, own)
    )
    return new > old + SAME_FACE


def touches_ground(robot: Robot, contacts: Contacts, leg: int) -> bool:
    """Returns whether a foot has a contact."""
    return any(
        spot.leg == leg and not held.is_open
        for spot, held in zip(spots(robot), contacts.held, strict=True)
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


def ground_under(robot: Robot, spot: Spot, centre: Array, side: int = 2) -> Held:
    """Returns an open contact with the ground at a sphere's centre (3,), or with its patch.

    side: axis of the torso whose side faces the ground.

    A patch with a kinetic coefficient of its own has no static rise unless it gives one. Walls are
    rigid, of the patch's friction, and for torso, knees and shanks blocks with edges.
    """
    surface = surface_of(robot.terrain)
    x, y = float(centre[0]), float(centre[1])
    sinks = spot.leg >= 0 or surface is None or not is_uneven(surface, x, y)
    own = soil_for(robot.soil, robot, spot, side) if sinks else Soil()
    held = replace(own_ground(robot, spot), soil=own, side=side)
    if surface is None or surface.materials is None:
        return held
    number = surface.material_at(x, y)
    if number == 0:
        return held
    row = surface.materials[number - 1]
    # a row with a kinetic coefficient alone has no higher static one
    mu = held.friction.mu if math.isnan(row[MU]) else float(row[MU])
    fallback = held.friction.mu_static if math.isnan(row[MU]) else mu
    mu_static = fallback if math.isnan(row[MU_STATIC]) else float(row[MU_STATIC])
    stiffness = robot.contact.stiffness if math.isnan(row[STIFFNESS]) else float(row[STIFFNESS])
    return replace(
        held,
        friction=replace(held.friction, mu=mu, mu_static=mu_static),
        contact=replace(robot.contact, stiffness=stiffness),
        soil=soil_for(row_soil(row[LAW:]), robot, spot, side) if sinks else Soil(),
    )


def closed(robot: Robot, spot: Spot, body: Array, impact_speed: float) -> Held:
    """Returns the contact of a sphere that touches down at a speed [m/s], at bodies (19, 13)."""
    sphere, damping = spot.sphere, contact_damping(robot.contact, impact_speed)
    side = side_on_ground(robot, sphere, body[sphere.body]) if sphere.pads else 2
    held = ground_under(robot, spot, sphere_centre(spot, body), side)
    return replace(held, damping=damping, impact_speed=impact_speed)


def start_contacts(robot: Robot, body: Array) -> Contacts:
    """Returns the contacts of bodies (19, 13) at the start: spheres in the ground are closed, with
    impact speed 0; those in soil have been pressed into it.
    """
    contacts = open_contacts(robot)
    depths = depths_of(robot, body, contacts)
    held, sunk = list(contacts.held), contacts.sunk.copy()
    for k, spot in enumerate(spots(robot)):
        if depths.delta[k] > 0.0:
            held[k] = closed(robot, spot, body, 0.0)
            if held[k].is_soft:
                depth = float(depths.delta[k])
                sunk[k] = plastic_depth(held[k].soil, spot.shape(robot, held[k].side), depth)
    pairs = standing_pairs(robot, body)
    contacts = replace(contacts, held=tuple(held), sunk=sunk, pairs=pairs)
    return hold_cells(robot, body, contacts)


def hold_cells(robot: Robot, body: Array, contacts: Contacts) -> Contacts:
    """Holds the cells of feet that touch blocks, are in their prints or in other blocks, and
    releases those of others.
    """
    surface = surface_of(robot.terrain)
    if surface is None or not has_cells(robot):
        return contacts
    cells: list[Cell | None] = []
    for leg, at in enumerate(foot_centres(robot, body)):
        holds = (
            contacts.sunk[leg] > 0.0
            or touches_ground(robot, contacts, leg)
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
        contacts, delta = tread(robot, body, contacts, delta)
        contacts = hold_cells(robot, body, contacts)
    held, touchdowns = list(contacts.held), 0
    walls = has_cells(robot)
    found = contacts_at(robot, body, contacts) if walls else []
    for k, spot in enumerate(spots(robot)):
        if held[k].is_open and delta[k] > 0.0:
            now = closed(robot, spot, body, float(depths.ddelta[k]))
            held[k] = _continued(robot, contacts, k, found, now) if walls else now
            touchdowns += 1
        elif not held[k].is_open and delta[k] <= 0.0:
            held[k] = replace(held[k], damping=math.nan)
    pairs = switched_pairs(robot, contacts, depths)
    touchdowns += sum(
        before.is_open and not now.is_open
        for before, now in zip(contacts.pairs, pairs, strict=True)
    )
    contacts = replace(contacts, pairs=pairs)
    if all(now is before for now, before in zip(held, contacts.held, strict=True)):
        return contacts, touchdowns
    return hold_cells(robot, body, replace(contacts, held=tuple(held))), touchdowns


def switched_pairs(robot: Robot, contacts: Contacts, depths: Depths) -> tuple[Held, ...]:
    """Returns the contacts between legs, closed where they overlap and open elsewhere."""
    found, first = [], len(contacts.held)
    for k, held in enumerate(contacts.pairs):
        depth, speed = float(depths.delta[first + k]), float(depths.ddelta[first + k])
        if held.is_open and depth > 0.0:
            damping = contact_damping(robot.contact, speed)
            found.append(replace(held, damping=damping, impact_speed=speed))
        else:
            found.append(held if depth > 0.0 else replace(held, damping=math.nan))
    return tuple(found)


def _continued(
    robot: Robot, contacts: Contacts, number: int, found: list[FootContact], now: Held
) -> Held:
    """Returns a contact that closes, with the impact of one that carries the same spot of the foot.

    A step that is lower than a foot is deep causes no impact of its own.
    """
    spot, depth, result = spots(robot)[number], 0.0, now
    for j, (other, held) in enumerate(zip(spots(robot), contacts.held, strict=True)):
        if spot.leg < 0 or other.leg != spot.leg or held.is_open:
            continue
        turn = float(np.sum((found[j].normal - found[number].normal) ** 2))
        near = turn * robot.foot.radius <= 4.0 * found[j].penetration
        if near and found[j].penetration > depth:
            depth = found[j].penetration
            result = replace(now, damping=held.damping, impact_speed=held.impact_speed)
    return result


# soil


def yield_soil(robot: Robot, contacts: Contacts, h: float, before: Depths, after: Depths) -> Array:
    """Returns the plastic depths (n,) of all spheres [m] at the end of a step of h [s] (eq. 44).

    They follow from the largest depths between the steps' ends. before, after: at the ends, with
    the plastic depths of the step.
    """
    sunk = contacts.sunk.copy()
    for k, (spot, held) in enumerate(zip(spots(robot), contacts.held, strict=True)):
        if held.is_open or not held.is_soft:
            continue
        from_, to = (float(ends.delta[k] + sunk[k]) for ends in (before, after))
        slopes = (h * float(before.ddelta[k]), h * float(after.ddelta[k]))
        depth = deepest(from_, slopes[0], to, slopes[1])
        shape = spot.shape(robot, held.side)
        sunk[k] = max(sunk[k], plastic_depth(held.soil, shape, depth))
    return sunk


def tread(robot: Robot, body: Array, contacts: Contacts, delta: Array) -> tuple[Contacts, Array]:
    """Records the prints that spheres leave upwards, and finds those that they enter from above.

    An open sphere below the undisturbed surface is above its footprint, whose bottom it may touch
    again; the footprint is complete when the sphere has left it upwards. Rigid ground beside a
    footprint has none. Depths (n,) follow the plastic depths to which they refer.
    """
    delta, sunk, place = delta.copy(), contacts.sunk.copy(), contacts.place.copy()
    prints = contacts.footprints
    for k, spot in _in_order_of_prints(robot):
        z, held, centre = delta[k] + sunk[k], contacts.held[k], sphere_centre(spot, body)
        if not held.is_open:
            if delta[k] <= 0.0:
                place[k] = place_of_print(robot, contacts, spot, centre)
            continue
        if z <= 0.0:
            if sunk[k] >= LEAST_FOOTPRINT:
                new = [*place[k], sunk[k], soil_radius(spot.shape(robot, held.side))]
                prints = np.vstack([prints, new])
            sunk[k] = 0.0
        elif sunk[k] == 0.0 and ground_under(robot, spot, centre).is_soft:
            sunk[k] = footprint_depth(prints, centre, surface_of(robot.terrain))
        delta[k] = z - sunk[k]
    return replace(contacts, sunk=sunk, place=place, footprints=prints), delta


def _in_order_of_prints(robot: Robot) -> list[tuple[int, Spot]]:
    """Returns the spheres that may sink with their numbers, in the order in which the C plant
    looks at them: feet, knees, shanks, corners of the torso.
    """
    spheres = [(k, spot) for k, spot in enumerate(spots(robot)) if spot.may_sink]
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
    closed = [j for j, held in enumerate(contacts.held) if not held.is_open]
    placed = [(spots(robot)[j], contacts.held[j], before[j]) for j in closed]
    share = dict(zip(closed, shares_of_feet(robot, placed).tolist(), strict=True))
    feet, held = spots(robot), list(contacts.held)
    for k, spot in enumerate(feet):
        if spot.leg not in gone:
            continue
        held[k], largest = replace(contacts.held[k], damping=math.nan), -1.0
        for j, other in enumerate(feet):
            same = other.leg == spot.leg and is_same_face(before[j], after[k])
            if same and j in share and share[j] > largest:
                largest = share[j]
                held[k] = taken_over(contacts.held[j], other, spot, held[k])
    return replace(moved, held=tuple(held))


def is_same_face(a: FootContact, b: FootContact) -> bool:
    """Returns whether two contacts of a foot are with the same face: one depth and normal."""
    turn = float(np.sum((a.normal - b.normal) ** 2))
    return abs(a.penetration - b.penetration) < SAME_FACE and turn < SAME_FACE


def taken_over(old: Held, from_: Spot, to: Spot, before: Held) -> Held:
    """Returns a contact that continues in another face. Bristles and soil are those of soles."""
    if from_.is_sole and to.is_sole:
        return old
    law = before.friction.law
    static = replace(old.friction, law=law)
    return replace(old, friction=static, soil=Soil())
