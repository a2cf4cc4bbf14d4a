"""Masses, centres of mass and inertia of the torso and of the links of all legs.

A body stays a possible one for all values: its inertia about the centre of mass is the robot file's
times a positive factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from hexapod_cosim.extensions.identify.numbers import Unknown
from hexapod_cosim.models import JOINT_NAMES, Robot

PAST = 0.25  # of the length of a link


def mass_row(joint: int | None) -> Unknown:
    """Returns the row of the mass of the torso (None) or of a link of all legs."""

    def read(robot: Robot) -> float:
        return float(_body(robot, joint).mass)

    def write(robot: Robot, value: float) -> Robot:
        factor = value / read(robot)
        return _with_bodies(
            robot,
            joint,
            lambda body: replace(
                body, mass=factor * body.mass, inertia=_scaled(body.inertia, factor)
            ),
        )

    return Unknown(
        key=f"{_name(joint)}.mass", unit="kg", group="mass", prior=0.2, read=read, write=write
    )


def com_row(joint: int | None, axis: int, prior: float) -> Unknown:
    """Returns the row of a coordinate of a centre of mass; all legs move alike."""

    def read(robot: Robot) -> float:
        return float(_body(robot, joint).com[axis])

    def write(robot: Robot, value: float) -> Robot:
        shift = value - read(robot)

        def moved(body: Any) -> Any:
            com = list(body.com)
            com[axis] += shift
            return replace(body, com=tuple(com))

        return _with_bodies(robot, joint, moved)

    return Unknown(
        key=f"{_name(joint)}.com[{axis + 1}]", unit="m", group="mass", prior=prior, positive=False,
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
        inertia = _scaled(robot.torso.inertia, (value / read(robot)) ** 2)
        return replace(robot, torso=replace(robot.torso, inertia=inertia))

    return Unknown(
        key="torso.gyration_radius", unit="m", group="mass", prior=0.2, read=read, write=write
    )


def _name(joint: int | None) -> str:
    return "torso" if joint is None else f"links.{JOINT_NAMES[joint]}"


def _body(robot: Robot, joint: int | None) -> Any:
    """Returns the torso or a link of the first leg."""
    return robot.torso if joint is None else robot.legs[0].links[joint]


def _scaled(inertia: Any, factor: float) -> Any:
    """Returns an inertia times a factor."""
    return tuple(factor * value for value in inertia)


def _with_bodies(robot: Robot, joint: int | None, change: Callable[[Any], Any]) -> Robot:
    """Returns the robot with the torso, or a link of every leg, changed."""
    if joint is None:
        return replace(robot, torso=change(robot.torso))
    legs = []
    for leg in robot.legs:
        links = [change(link) if k == joint else link for k, link in enumerate(leg.links)]
        legs.append(replace(leg, links=(links[0], links[1], links[2])))
    return replace(robot, legs=tuple(legs))
