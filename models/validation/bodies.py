"""Checks a robot as a whole, and its bodies: inertias, links, limits and stance."""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.errors import RobotError, check_type
from hexapod_cosim.models.kinematics import foot_positions, inertia_matrix
from hexapod_cosim.models.records import JOINT_NAMES, LEG_NAMES, Leg, Link, Robot
from hexapod_cosim.models.schema import Vector, check_record
from hexapod_cosim.models.validation.laws import check_laws

# a thin rod satisfies the triangle inequality with equality; rounding to four digits may violate it
INERTIA_ROUNDING = 1e-3


def check_inertia(mass: float, inertia: tuple[float, ...], extent: float, where: str) -> None:
    """Checks the inertia of a body. Raises RobotError.

    It must be positive definite, its principal moments must satisfy the triangle inequality, and
    its radius of gyration must be at most `extent` [m].
    """
    moments = np.linalg.eigvalsh(inertia_matrix(inertia))
    shown = [float(f"{moment:.4g}") for moment in moments]
    fix = "check units (kg m2), the reference point (centre of mass) and the signs of the products"
    if moments[0] <= 0.0:
        what = "inertia not positive definite"
        expected = "principal moments > 0"
        raise RobotError(what, got=shown, expected=expected, fix=fix, where=where + ".inertia")
    if moments[0] + moments[1] < (1.0 - INERTIA_ROUNDING) * moments[2]:
        expected = "principal moments of which no one exceeds the sum of the others"
        what = "inertia of no possible body"
        raise RobotError(what, got=shown, expected=expected, fix=fix, where=where + ".inertia")
    radius = math.sqrt(float(moments.sum()) / (2.0 * mass))
    if radius > extent:
        expected = f"a radius of gyration of at most {extent:.3g} m for matter of this extent"
        what = "inertia too large for the mass"
        got = f"{radius:.3g} m"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where + ".inertia")


def check_com(com: tuple[float, ...], extent: float, where: str) -> None:
    """Raises RobotError for a centre of mass further than `extent` [m] from its frame."""
    if math.hypot(*com) > extent:
        what = "centre of mass outside the body"
        expected = f"within {extent:.3g} m of the frame"
        fix = "check the unit (m)"
        raise RobotError(what, got=com, expected=expected, fix=fix, where=where + ".com")


# a short bracket may carry a servo longer than itself; real links stay below 0.8
GYRATION_PER_EXTENT = 2.0
# m  distance of a stance foot from the plane of all six; legs sag under load by about as much
STANCE_PLANE_TOLERANCE = 0.01
AXIS_TOLERANCE = 1e-6


def check_leg(leg: Leg, where: str) -> None:
    """Checks the links of a leg, and that its stance is within the joints' limits.

    Raises RobotError.
    """
    check_record(leg, where)
    for link, joint, stance in zip(leg.links, JOINT_NAMES, leg.stance, strict=True):
        _check_link(link, f"{where}.{joint}")
        if not link.angle_min <= stance <= link.angle_max:
            expected = f"{link.angle_min:.4g} to {link.angle_max:.4g} rad"
            raise RobotError(
                "stance outside the joint's limits",
                got=stance,
                expected=expected,
                fix="change the pose or the limits",
                where=f"{where}.{joint}.stance",
            )


def _check_link(link: Link, where: str) -> None:
    check_record(link, where)
    extent = math.hypot(*link.tip)
    if extent <= 0.0:
        what = "link without extent"
        expected = "a tip away from the joint"
        fix = "give a length"
        raise RobotError(what, got=link.tip, expected=expected, fix=fix, where=where + ".length")
    check_inertia(link.mass, link.inertia, GYRATION_PER_EXTENT * extent, where)
    check_com(link.com, GYRATION_PER_EXTENT * extent, where)
    if abs(math.hypot(*link.axis) - 1.0) > AXIS_TOLERANCE:
        what = "axis not of unit length"
        expected = "a unit vector"
        fix = "normalise it"
        raise RobotError(what, got=link.axis, expected=expected, fix=fix, where=where + ".axis")
    if link.angle_min >= link.angle_max:
        got = [link.angle_min, link.angle_max]
        what = "limits not ordered"
        expected = "angle_min < angle_max"
        fix = "swap or correct them (rad)"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where + ".angle_min")


def check_stance(robot: Robot, at: str) -> None:
    """Checks that all feet of the stance reach one plane below the hips. Raises RobotError."""
    feet = foot_positions(robot, robot.stance)
    distance, slope = _plane_fit(feet)
    worst = int(np.argmax(np.abs(distance)))
    where = f"{at}legs.{LEG_NAMES[worst]}.stance"
    if abs(distance[worst]) > STANCE_PLANE_TOLERANCE:
        got = f"{distance[worst]:.4g} m off the plane of the other feet"
        what = "a stance foot does not reach the ground"
        expected = f"at most {STANCE_PLANE_TOLERANCE} m"
        fix = "adapt this leg's stance"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where)
    if slope > 0.5:
        what = "the stance feet do not lie below the torso"
        got = f"slope {slope:.3g}"
        fix = "adapt the stance"
        raise RobotError(what, got=got, expected="at most 0.5", fix=fix, where=at + "legs")
    hips = np.array([leg.hip_position for leg in robot.legs])
    high = int(np.argmax(feet[:, 2] - hips[:, 2]))
    if feet[high, 2] - robot.foot.radius >= hips[high, 2]:
        got = f"{feet[high, 2] - hips[high, 2]:.4g} m above the hip"
        raise RobotError(
            "a stance foot is above its hip",
            got=got,
            expected="below",
            fix="adapt this leg's stance",
            where=f"{at}legs.{LEG_NAMES[high]}.stance",
        )


def _plane_fit(points: Array) -> tuple[Array, float]:
    """Returns heights above the least-squares plane z = c + ax + by, and that plane's slope."""
    columns = np.column_stack([np.ones(len(points)), points[:, :2]])
    plane = np.linalg.lstsq(columns, points[:, 2], rcond=None)[0]
    return points[:, 2] - columns @ plane, float(np.hypot(plane[1], plane[2]))


# matter lies within the box; real torsos stay below half of this limit
GYRATION_PER_DIAGONAL = 1.0
# sections that do not concern the bodies
SETTINGS = ("contact", "friction", "servo", "baumgarte", "solver", "terrain", "soil", "body")


def check_robot(robot: Robot, *, where: str | None = None) -> None:
    """Checks a robot. Raises RobotError for the first violated rule.

    where: name of the robot's file for messages.
    """
    check_type(robot, Robot, "a Robot, as of load_robot()", where="robot", error=RobotError)
    at = f"{where or robot.name}: "
    Vector("m/s2", 3).read(robot.gravity, at + "gravity")
    for name in ("torso", "foot", "gait"):
        check_record(getattr(robot, name), at + name)
    check_settings(robot, where=where)
    check_inertia(
        robot.torso.mass,
        robot.torso.inertia,
        GYRATION_PER_DIAGONAL * math.hypot(*robot.torso.size),
        at + "torso",
    )
    check_com(robot.torso.com, math.hypot(*robot.torso.size), at + "torso")
    if tuple(leg.name for leg in robot.legs) != LEG_NAMES:
        expected = "legs " + " ".join(LEG_NAMES)
        got = [leg.name for leg in robot.legs]
        fix = "give these six in this order"
        raise RobotError("wrong legs", got=got, expected=expected, fix=fix, where=at + "legs")
    for leg in robot.legs:
        check_leg(leg, f"{at}legs.{leg.name}")
    check_stance(robot, at)
    names, count = set(robot.joints.names), len(robot.joints.names)
    if not count == len(names) == 18 or not names.issuperset(robot.joints.reversed):
        raise RobotError(
            "wrong names of joints",
            got=f"{count} names, {len(names)} of them different",
            expected="18 from LF to RR, coxa, femur and tibia of each, and reversed ones of these",
            fix="give all of them, or leave [joints] out",
            where=f"{at}joints",
        )


def check_settings(robot: Robot, *, where: str | None = None) -> None:
    """Checks the robot's laws and settings only, for a robot with checked bodies.

    Raises RobotError.
    """
    at = f"{where or robot.name}: "
    for name in SETTINGS:
        check_record(getattr(robot, name), at + name)
    check_laws(robot, at)
