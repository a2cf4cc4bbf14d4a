"""Masses, centres of mass and inertia of the torso and of the links of all legs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from hexapod_cosim.extensions.identify.numbers.inertia import BodyInertia, body_inertia
from hexapod_cosim.extensions.identify.numbers.unknown import Unknown
from hexapod_cosim.models import JOINT_NAMES, Robot

PAST = 0.25  # of the length of a link


def mass_row(joint: int | None) -> Unknown:
    """Returns the row of the mass of the torso (None) or of a link of all legs."""
    name = "torso" if joint is None else f"links.{JOINT_NAMES[joint]}"

    def read(robot: Robot) -> float:
        return float(_body(robot, joint).mass)

    def write(robot: Robot, value: float) -> Robot:
        factor = value / read(robot)
        return _with_bodies(robot, joint, lambda body: body.with_mass(body.mass * factor))

    return Unknown(key=f"{name}.mass", unit="kg", group="mass", prior=0.2, read=read, write=write)


def com_row(joint: int | None, axis: int, prior: float) -> Unknown:
    """Returns the row of a coordinate of a centre of mass; all legs move alike."""
    name = "torso" if joint is None else f"links.{JOINT_NAMES[joint]}"

    def read(robot: Robot) -> float:
        return float(_body(robot, joint).com[axis])

    def write(robot: Robot, value: float) -> Robot:
        shift = value - read(robot)

        def moved(body: Any) -> Any:
            com = list(body.com)
            com[axis] += shift
            return body.with_com(com)

        return _with_bodies(robot, joint, moved)

    return Unknown(
        key=f"{name}.com[{axis + 1}]", unit="m", group="mass", prior=prior, positive=False,
        read=read, write=write,
        limits_of=None if joint is None or axis else lambda robot: _along(robot, joint),
    )  # fmt: skip


def _along(robot: Robot, joint: int) -> tuple[float, float]:
    """Returns between which places along a link its centre of mass can be [m].

    That is between its joint and the next one (the foot), and PAST of the length beyond either,
    because housings of servos stick out. What the robot file says is always possible.
    """
    links = [leg.links[joint] for leg in robot.legs]
    low, high = (
        [side * PAST * abs(one.length) + place * one.length for one in links]
        for side, place in ((-1.0, 0.0), (1.0, 1.0))
    )
    own = float(links[0].com[0])
    return min(*low, *high, own), max(*low, *high, own)


def gyration_row() -> Unknown:
    """Returns the row of the torso's radius of gyration: the root of the mean square distance of
    its mass from its centre, sqrt(trace I / 2 m). The shape of the inertia stays.
    """

    def read(robot: Robot) -> float:
        return math.sqrt(sum(robot.torso.inertia[:3]) / (2.0 * robot.torso.mass))

    def write(robot: Robot, value: float) -> Robot:
        factor = value / read(robot)
        return _with_bodies(robot, None, lambda body: body.scaled(factor))

    return Unknown(
        key="torso.gyration_radius", unit="m", group="mass", prior=0.2, read=read, write=write
    )


def _body(robot: Robot, joint: int | None) -> Any:
    """Returns the torso or a link of the first leg."""
    return robot.torso if joint is None else robot.legs[0].links[joint]


def _with_bodies(robot: Robot, joint: int | None, change: Callable[[Any], Any]) -> Robot:
    """Returns the robot with the torso, or a link of every leg, changed as a possible body."""
    found: dict[Any, Any] = {}  # links of most legs are alike

    def changed(body: Any) -> Any:
        key = body.mass, tuple(body.com), tuple(body.inertia)
        if key not in found:
            found[key] = _changed_body(key, change)
        mass, com, inertia = found[key]
        return replace(body, mass=mass, com=com, inertia=inertia)

    if joint is None:
        return replace(robot, torso=changed(robot.torso))
    legs = []
    for leg in robot.legs:
        links = list(leg.links)
        links[joint] = changed(links[joint])
        legs.append(replace(leg, links=(links[0], links[1], links[2])))
    return replace(robot, legs=tuple(legs))


def _changed_body(body: Any, change: Callable[[BodyInertia], BodyInertia]) -> Any:
    """Returns mass, centre of mass and inertia of a changed body; what does not change keeps every
    digit.
    """
    old = body_inertia(*body)
    new = change(old)
    mass = body[0] if new.size == old.size else new.mass
    alike = mass == body[0] and (new.widths, new.shears) == (old.widths, old.shears)
    return mass, new.com, body[2] if alike else new.inertia
