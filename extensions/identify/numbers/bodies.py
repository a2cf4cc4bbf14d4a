"""Masses, centres of mass and inertia of the torso and of the links of all legs.

A body stays a possible one for all values: its inertia about the centre of mass is the robot file's
times a positive factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.numbers import Unknown
from hexapod_cosim.models import JOINT_NAMES, Robot
from hexapod_cosim.models.records import Link

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


def com_row(axis: int, prior: float) -> Unknown:
    """Returns the row of a coordinate of the torso's centre of mass."""

    def read(robot: Robot) -> float:
        return float(robot.torso.com[axis])

    def write(robot: Robot, value: float) -> Robot:
        com = list(robot.torso.com)
        com[axis] = value
        return replace(robot, torso=replace(robot.torso, com=(com[0], com[1], com[2])))

    return Unknown(
        key=f"torso.com[{axis + 1}]", unit="m", group="mass", prior=prior, positive=False,
        read=read, write=write,
    )  # fmt: skip


def along_row(joint: int, prior: float) -> Unknown:
    """Returns the row of how far a centre of mass lies along its link; all legs move alike.

    The direction is that from the joint to the next one (the foot), wherever the angle 0 is. The
    centre lies between the two joints or PAST of the length beyond either, because housings of
    servos stick out. What the robot file says is always possible.
    """

    def read(robot: Robot) -> float:
        link = robot.legs[0].links[joint]
        return float(np.dot(link.com, _direction(link)))

    def write(robot: Robot, value: float) -> Robot:
        shift = value - read(robot)

        def moved(link: Any) -> Any:
            return replace(link, com=tuple((link.com + shift * _direction(link)).tolist()))

        return _with_bodies(robot, joint, moved)

    def limits(robot: Robot) -> tuple[float, float]:
        longest = max(math.hypot(*leg.links[joint].tip) for leg in robot.legs)  # m
        own = read(robot)
        return min(-PAST * longest, own), max((1.0 + PAST) * longest, own)

    return Unknown(
        key=f"{_name(joint)}.com_along", unit="m", group="mass", prior=prior, positive=False,
        read=read, write=write, limits_of=limits,
    )  # fmt: skip


def _direction(link: Link) -> NDArray[np.float64]:
    """Returns the direction (3,) from a link's joint to the next one."""
    return np.array(link.tip) / math.hypot(*link.tip)


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
