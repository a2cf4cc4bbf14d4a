"""Checks settings of laws that concern more than one number: friction, ground, soil, servos.

The plant checks further ones when it starts (plant_fmu/src/robot/validation.c).
"""

from __future__ import annotations

import math

from hexapod_cosim.models.contact.law import BodyContact
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.friction import LAWS, Friction
from hexapod_cosim.models.ground.surface import LAW, Surface
from hexapod_cosim.models.ground.valleys import tightest_valley
from hexapod_cosim.models.records import Robot, Servo
from hexapod_cosim.models.servos.presets import check_constants

# 1  least radius of valleys over that of a sphere in them; one nearest point needs 1, and the books
# of energy close from 1.01 on
VALLEY_MARGIN = 1.05


def check_terrain(robot: Robot, where: str) -> None:
    """Checks that a ground of the kind grid has a surface, and that it suits the robot.

    Raises RobotError.
    """
    terrain = robot.terrain
    if terrain.kind != "grid":
        return
    if terrain.surface is None:
        what = "no surface"
        expected = "a surface of the ground"
        fix = 'give Terrain(kind="grid", surface=...)'
        raise RobotError(what, got=None, expected=expected, fix=fix, where=where + ".surface")
    check_contact_surface(robot, terrain.surface, where)


def check_contact_surface(robot: Robot, surface: Surface, where: str) -> None:
    """Checks that blocks and valleys of a surface are wide enough for the spheres that touch it,
    and that blocks are rigid.

    A sphere touches one block of a row beside it at most. In a valley narrower than a sphere it
    touches at two places, of which the plant computes one: forces jump, and energy is not
    conserved. Raises RobotError; `where` names the surface.
    """
    tables = () if surface.materials is None else surface.materials
    if surface.kind == "blocks" and (robot.soil.law != "none" or any(row[LAW] for row in tables)):
        what = "soil on blocks"
        expected = "rigid ground, because soil needs a smooth surface"
        fix = "take soil away, or choose plane, sand or another smooth terrain"
        raise RobotError(what, got=surface.name, expected=expected, fix=fix, where=where)
    name, radius = _largest_sphere(robot)
    part = "foot" if name == "foot.radius" else "part"
    if surface.kind == "blocks" and surface.cell < 2.0 * radius:
        what = f"blocks narrower than a {part}"
        expected = f"at least twice {name}, {2.0 * radius:g} m"
        fix = f"enlarge terrain.horizontal_scale, or reduce {name}"
        raise RobotError(what, got=f"{surface.cell:.4g} m", expected=expected, fix=fix, where=where)
    limit = VALLEY_MARGIN * radius
    valley = tightest_valley(surface, limit)
    if valley is None:
        return
    raise RobotError(
        f"valleys narrower than a {part}",
        got=f"a radius of curvature of {1e3 * valley.radius:.4g} mm at x = {valley.x:.4g} m, "
        f"y = {valley.y:.4g} m",
        expected=f"at least {1e3 * limit:.4g} mm, {VALLEY_MARGIN:g} times {name}",
        fix=f"set terrain.smooth = {math.ceil(1e5 * limit) / 1e5:g} of a heightfield, or its "
        "slope_threshold for blocks; else enlarge terrain.horizontal_scale, reduce difficulty or "
        f"heights, or {name}",
        where=where,
    )


def _largest_sphere(robot: Robot) -> tuple[str, float]:
    """Returns the key and the radius [m] of the largest sphere that touches the ground."""
    spheres = {"foot.radius": robot.foot.radius}
    if robot.body.contact == "on":
        for part in ("corner_radius", "knee_radius", "shank_radius"):
            spheres[f"body.{part}"] = getattr(robot.body, part)
    return max(spheres.items(), key=lambda sphere: sphere[1])


def check_soil(robot: Robot, at: str) -> None:
    """Raises RobotError for soil that bears nothing, or whose unloading is softer than loading."""
    soil = robot.soil
    strength = {
        "bekker": soil.frictional_modulus + soil.cohesive_modulus,
        "granular": soil.resistance * soil.alpha_down,
        "mud": soil.yield_pressure + soil.hardening,
    }
    if soil.law != "none" and strength[soil.law] <= 0.0:
        what = "soil that bears no load"
        got = strength[soil.law]
        expected = f"numbers of the {soil.law} law above 0"
        fix = "give the law's numbers, or a soil of `hexapod list soils`"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=at + "soil")
    steepest = {"granular": strength["granular"], "mud": soil.hardening}.get(soil.law, 0.0)
    if steepest >= soil.stiffness:
        what = "soil whose unloading is no steeper than its loading"
        got = soil.stiffness
        expected = f"a stiffness above {steepest:g} Pa/m, the growth of pressure with depth"
        fix = "raise soil.stiffness"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=at + "soil.stiffness")


def check_laws(robot: Robot, at: str) -> None:
    """Checks the settings of all laws of a robot. Raises RobotError."""
    check_soil(robot, at)
    check_servo(robot.servo, at)
    check_static_friction(robot.friction, at + "friction.mu_static")
    check_terrain(robot, at + "terrain")
    check_body_contact(robot.body, at + "body")


def check_static_friction(friction: Friction, where: str) -> None:
    """Checks that static friction is not below kinetic friction and that the law uses it.

    Raises RobotError.
    """
    static, mu = friction.mu_static, friction.mu
    if static in (0.0, mu):
        return
    if static < mu:
        what = "static friction below kinetic"
        fix = "raise it or leave it out"
        raise RobotError(what, got=static, expected=f"at least mu = {mu:g}", fix=fix, where=where)
    if not friction.has_friction:
        laws = " or ".join(name for name, law in LAWS.items() if law.has_friction)
        what = "static friction that has no effect"
        got = f"{static:g} with the law {friction.law}"
        expected = f"friction.law = {laws}" if laws else f"mu = {mu:g}: no law uses another"
        fix = "leave it out" + (f", or choose the law {laws}" if laws else "")
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where)


def check_body_contact(body: BodyContact, where: str) -> None:
    """Checks that the box has no negative edges, and that a body with contact has a sphere.

    Raises RobotError.
    """
    if min(body.torso_box) < 0.0:
        what = "a box with negative edges"
        expected = "half edges >= 0 m"
        fix = "correct them; all 0: the torso touches nothing"
        edges, at = list(body.torso_box), where + ".torso_box"
        raise RobotError(what, got=edges, expected=expected, fix=fix, where=at)
    if body.contact == "on" and not any((*body.torso_box, body.knee_radius, body.shank_radius)):
        what = "body contact without a body"
        got = "torso_box, knee_radius and shank_radius of 0"
        expected = "at least one of them > 0 m"
        fix = "give the robot's sizes, or leave body.contact off"
        raise RobotError(what, got=got, expected=expected, fix=fix, where=where + ".contact")


def check_servo(servo: Servo, at: str) -> None:
    """Checks the constants of motors and the continuous torque. Raises RobotError."""
    if servo.drive == "motor":
        check_constants(vars(servo), at + "servo")
    if servo.torque_continuous > servo.torque_max:
        raise RobotError(
            "more torque for ever than at stall",
            got=servo.torque_continuous,
            expected=f"at most torque_max = {servo.torque_max:g} N m",
            fix="lower it",
            where=at + "servo.torque_continuous",
        )
