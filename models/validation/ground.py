"""Checks the ground of a robot: surface and soil suit the spheres that touch them."""

from __future__ import annotations

from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.valleys import tightest_valley
from hexapod_cosim.models.records import Robot

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
    and that blocks of the robot's own soil are level.

    A sphere touches one block of a row beside it at most. In a valley narrower than a sphere it
    touches at two places, of which the plant computes one: forces jump, and energy is not
    conserved. Raises RobotError; `where` names the surface.
    """
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
        fix="enlarge terrain.horizontal_scale, reduce difficulty or heights, choose blocks (a "
        f"heightfield with slope_threshold), or reduce {name}",
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
