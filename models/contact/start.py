"""Finds what starts too deep in the ground: at such depths the contact law does not hold, and its
force would throw the robot up.

The fast form is plant_fmu/src/plant/start.c.
"""

from __future__ import annotations

from dataclasses import dataclass

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.forces import candidates
from hexapod_cosim.models.contact.switching import depths_of, start_contacts
from hexapod_cosim.models.records import Foot, Robot, Soil
from hexapod_cosim.models.soil.law import sinkage, virgin_force


@dataclass(frozen=True)
class DeepStart:
    """A sphere that starts deeper in the ground than it may."""

    name: str  # foot LF, knee LF, shank LF, torso corner
    depth: float  # m  of its lowest point
    bound: float  # m
    reason: str  # what the bound is


def deepest_start(robot: Robot, body: Array) -> DeepStart | None:
    """Returns the sphere that is furthest below the depth at which it may start, of bodies (19,
    13); None if all may start.

    A sphere may be as deep as its radius, where its centre reaches the surface; in soil as deep as
    where the soil carries the robot's weight on it alone, if that is deeper. Corners of the torso
    that are points may be as deep as feet, because the force at a depth is the same.
    """
    contacts, found = start_contacts(robot, body), list[DeepStart]()
    depths = depths_of(robot, body, contacts).delta
    for k, point in enumerate(candidates(robot)):
        state, depth = contacts.states[k], float(depths[k] + contacts.soil_depth[k])
        if not point.may_sink:
            continue
        own = point.sphere.radius
        radius = own or robot.foot.radius
        reason = "its radius" if own > 0.0 else "the radius of a foot"
        bound = radius
        if depth > radius and state.is_soft:
            bound = _soil_bound(robot, state.soil, point.shape(robot, state.side), radius)
        if bound > radius:
            reason = "where the soil carries the robot's weight on it"
        if depth > bound:
            leg, _, part = point.sphere.name.rpartition(".")
            found.append(
                DeepStart(f"{part} {leg}" if leg else "torso corner", depth, bound, reason)
            )
    return max(found, key=lambda one: one.depth - one.bound, default=None)


def _soil_bound(robot: Robot, soil: Soil, shape: Foot, radius: float) -> float:
    """Returns the depth [m] at which soil carries the robot's weight, at least a radius."""
    if virgin_force(soil, shape, radius) > robot.weight:
        return radius
    return max(sinkage(soil, shape, robot.weight), radius)
