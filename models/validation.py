"""Checks whether a robot is physically possible, by rules that need more than one number.

The annotations of the records check single values. A robot with impossible inertias would simulate
wrongly, so it is rejected on load.
"""

from __future__ import annotations

import math

import numpy as np

from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.surface import Surface
from hexapod_cosim.models.ground.valleys import tightest_valley
from hexapod_cosim.models.kinematics import foot_positions, inertia_matrix
from hexapod_cosim.models.records import (
    JOINT_NAMES,
    LEG_NAMES,
    STATIC_LAWS,
    Array,
    BodyContact,
    Friction,
    Leg,
    Link,
    Robot,
    Servo,
)
from hexapod_cosim.models.schema import Vector, check_record

# a thin rod satisfies the triangle inequality with equality; rounding to four digits may violate it
INERTIA_ROUNDING = 1e-3
# a short bracket may carry a servo longer than itself; real links stay below 0.8
GYRATION_PER_EXTENT = 2.0
# matter lies within the box; real torsos stay below half of this limit
GYRATION_PER_DIAGONAL = 1.0
# m  distance of a stance foot from the plane of all six; legs sag under load by about as much
STANCE_PLANE_TOLERANCE = 0.01
AXIS_TOLERANCE = 1e-6
# sections that do not concern the bodies
SETTINGS = ("contact", "friction", "servo", "baumgarte", "solver", "terrain", "soil", "body")
# 1  least radius of valleys over that of a sphere in them; one nearest point needs 1, and the books
# of energy close from 1.01 on
VALLEY_MARGIN = 1.05
DISSIPATIVE_LAWS = ("exact_restitution", "flores", "lankarani_nikravesh", "hunt_crossley")


def check_robot(robot: Robot, *, where: str | None = None) -> None:
    """Checks a robot. Raises RobotError for the first violated rule.

    where: name of the robot's file for messages.
    """
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
    _check_com(robot.torso.com, math.hypot(*robot.torso.size), at + "torso")
    if tuple(leg.name for leg in robot.legs) != LEG_NAMES:
        expected = "legs " + " ".join(LEG_NAMES)
        raise RobotError(
            "wrong legs",
            got=[leg.name for leg in robot.legs],
            expected=expected,
            fix="give these six in this order",
            where=at + "legs",
        )
    for leg in robot.legs:
        _check_leg(leg, f"{at}legs.{leg.name}")
    _check_rotors(robot, at)
    _check_stance(robot, at)


def check_settings(robot: Robot, *, where: str | None = None) -> None:
    """Checks the robot's laws and settings only, for a robot with checked bodies.

    Raises RobotError.
    """
    at = f"{where or robot.name}: "
    for name in SETTINGS:
        check_record(getattr(robot, name), at + name)
    _check_laws(robot, at)


def check_inertia(mass: float, inertia: tuple[float, ...], extent: float, where: str) -> None:
    """Checks the inertia of a body. Raises RobotError.

    It must be positive definite, its principal moments must satisfy the triangle inequality, and
    its radius of gyration must be at most `extent` [m].
    """
    moments = np.linalg.eigvalsh(inertia_matrix(inertia))
    shown = [float(f"{moment:.4g}") for moment in moments]
    fix = "check units (kg m2), the reference point (centre of mass) and the signs of the products"
    if moments[0] <= 0.0:
        raise RobotError(
            "inertia not positive definite",
            got=shown,
            expected="principal moments > 0",
            fix=fix,
            where=where + ".inertia",
        )
    if moments[0] + moments[1] < (1.0 - INERTIA_ROUNDING) * moments[2]:
        expected = "principal moments of which no one exceeds the sum of the others"
        raise RobotError(
            "inertia of no possible body",
            got=shown,
            expected=expected,
            fix=fix,
            where=where + ".inertia",
        )
    radius = math.sqrt(float(moments.sum()) / (2.0 * mass))
    if radius > extent:
        expected = f"a radius of gyration of at most {extent:.3g} m for matter of this extent"
        raise RobotError(
            "inertia too large for the mass",
            got=f"{radius:.3g} m",
            expected=expected,
            fix=fix,
            where=where + ".inertia",
        )


def _check_leg(leg: Leg, where: str) -> None:
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
        raise RobotError(
            "link without extent",
            got=link.tip,
            expected="a tip away from the joint",
            fix="give a length",
            where=where + ".length",
        )
    check_inertia(link.mass, link.inertia, GYRATION_PER_EXTENT * extent, where)
    _check_com(link.com, GYRATION_PER_EXTENT * extent, where)
    if abs(math.hypot(*link.axis) - 1.0) > AXIS_TOLERANCE:
        raise RobotError(
            "axis not of unit length",
            got=link.axis,
            expected="a unit vector",
            fix="normalise it",
            where=where + ".axis",
        )
    if link.angle_min >= link.angle_max:
        got = [link.angle_min, link.angle_max]
        raise RobotError(
            "limits not ordered",
            got=got,
            expected="angle_min < angle_max",
            fix="swap or correct them (rad)",
            where=where + ".angle_min",
        )


def _check_com(com: tuple[float, ...], extent: float, where: str) -> None:
    if math.hypot(*com) > extent:
        raise RobotError(
            "centre of mass outside the body",
            got=com,
            expected=f"within {extent:.3g} m of the frame",
            fix="check the unit (m)",
            where=where + ".com",
        )


def _check_soil(robot: Robot, at: str) -> None:
    """Raises RobotError for soil that bears nothing, or whose unloading is softer than loading."""
    soil = robot.soil
    strength = {
        "bekker": soil.frictional_modulus + soil.cohesive_modulus,
        "granular": soil.resistance * soil.alpha_down,
        "mud": soil.yield_pressure + soil.hardening,
    }
    if soil.law != "none" and strength[soil.law] <= 0.0:
        raise RobotError(
            "soil that bears no load",
            got=strength[soil.law],
            expected=f"numbers of the {soil.law} law above 0",
            fix="give the law's numbers, or a soil of `hexapod list soils`",
            where=at + "soil",
        )
    steepest = {"granular": strength["granular"], "mud": soil.hardening}.get(soil.law, 0.0)
    if steepest >= soil.stiffness:
        raise RobotError(
            "soil whose unloading is no steeper than its loading",
            got=soil.stiffness,
            expected=f"a stiffness above {steepest:g} Pa/m, the growth of pressure with depth",
            fix="raise soil.stiffness",
            where=at + "soil.stiffness",
        )


def _check_laws(robot: Robot, at: str) -> None:
    contact, solver, servo, friction = robot.contact, robot.solver, robot.servo, robot.friction
    if contact.law in DISSIPATIVE_LAWS and contact.restitution <= 0.0:
        fix = "give a positive value, or choose the hertz or constant_damping law"
        raise RobotError(
            "no finite damping for this law",
            got=contact.restitution,
            expected="restitution > 0",
            fix=fix,
            where=at + "contact.restitution",
        )
    if solver.method == "rk4" and solver.step <= 0.0:
        raise RobotError(
            "rk4 has no error control",
            got=solver.step,
            expected="a fixed step > 0 s",
            fix="set solver.step",
            where=at + "solver.step",
        )
    _check_soil(robot, at)
    _check_motor(servo, at)
    _check_gear(servo, at)
    if servo.torque_continuous > servo.torque_max:
        expected = f"at most torque_max = {servo.torque_max:g} N m"
        raise RobotError(
            "more torque for ever than at stall",
            got=servo.torque_continuous,
            expected=expected,
            fix="lower it",
            where=at + "servo.torque_continuous",
        )
    _check_static_friction(friction, at + "friction.mu_static")
    _check_terrain(robot, at + "terrain")
    _check_body(robot.body, at + "body")


def _check_gear(servo: Servo, at: str) -> None:
    if servo.gear_stiffness > 0.0 and servo.rotor_inertia == 0.0:
        raise RobotError(
            "elastic gear without a rotor",
            got=servo.rotor_inertia,
            expected="rotor_inertia > 0 with gear_stiffness, whose gear moves the rotor",
            fix="give servo.rotor_inertia, or set servo.gear_stiffness to 0",
            where=at + "servo.rotor_inertia",
        )
    if servo.backlash > 0.0 and servo.gear_stiffness == 0.0:
        raise RobotError(
            "play in a rigid gear",
            got=servo.gear_stiffness,
            expected="gear_stiffness > 0 with backlash, whose teeth meet elastically",
            fix="give servo.gear_stiffness, or set servo.backlash to 0",
            where=at + "servo.gear_stiffness",
        )


def _check_rotors(robot: Robot, at: str) -> None:
    """Fails for rotors that are heavier than the bodies which contain them.

    The inertia of each about its own axis is J_r/n^2, and the torso has six.
    """
    ratio, compliance = robot.servo.gear_ratio, 0.0
    if ratio == 0.0:
        return
    for leg in robot.legs:
        c, s = math.cos(leg.hip_yaw), math.sin(leg.hip_yaw)
        hip = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ leg.links[0].axis
        carriers = [(robot.torso.inertia, hip, len(robot.legs))]
        carriers += [(leg.links[k].inertia, np.array(leg.links[k + 1].axis), 1) for k in range(2)]
        for inertia, axis, count in carriers:
            form = float(axis @ np.linalg.solve(inertia_matrix(inertia), axis))
            compliance = max(compliance, count * form)
    if robot.servo.rotor_inertia * compliance >= ratio**2:
        least = math.sqrt(robot.servo.rotor_inertia * compliance)
        raise RobotError(
            "rotors heavier than the bodies that contain them",
            got=ratio,
            expected=f"0, or a size above {least:.3g}: rotor_inertia/gear_ratio^2 is a rotor's "
            "inertia about its own axis",
            fix="give servo.gear_ratio as turns of the rotor for one of the joint",
            where=at + "servo.gear_ratio",
        )


def _check_motor(servo: Servo, at: str) -> None:
    """Checks that a motor has its constants."""
    motor = servo.drive == "motor"
    if servo.winding_capacity > 0.0 and servo.housing_capacity == 0.0:
        raise RobotError(
            "a housing without heat capacity",
            got=servo.housing_capacity,
            expected="a number > 0 [J/K] where winding_capacity is",
            fix="give servo.housing_capacity",
            where=at + "servo.housing_capacity",
        )
    coolest = max(servo.derate_temperature, servo.air_temperature)
    if servo.temperature_max <= coolest:
        raise RobotError(
            "windings that are never too hot",
            got=servo.temperature_max,
            expected=f"more than {coolest:g} K, derate_temperature and air_temperature",
            fix="raise servo.temperature_max",
            where=at + "servo.temperature_max",
        )
    for key in ("voltage", "torque_constant", "resistance"):
        if motor and not getattr(servo, key) > 0.0:
            raise RobotError(
                "a motor without its constants",
                got=getattr(servo, key),
                expected="a number > 0 with the drive motor",
                fix=f"give servo.{key}, or a servo of `hexapod list servos` as servo.model",
                where=at + f"servo.{key}",
            )


def _check_terrain(robot: Robot, where: str) -> None:
    """Checks that a ground of the kind grid has a surface, and that it suits the robot."""
    terrain = robot.terrain
    if terrain.kind != "grid":
        return
    if terrain.surface is None:
        raise RobotError(
            "no surface",
            got=None,
            expected="a surface of the ground",
            fix='give Terrain(kind="grid", surface=...)',
            where=where + ".surface",
        )
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
        raise RobotError(
            f"blocks narrower than a {part}",
            got=f"{surface.cell:.4g} m",
            expected=f"at least twice {name}, {2.0 * radius:g} m",
            fix=f"enlarge terrain.horizontal_scale, or reduce {name}",
            where=where,
        )
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


def _check_body(body: BodyContact, where: str) -> None:
    """Checks that the box has no negative edges, and that a body with contact has a sphere."""
    if min(body.torso_box) < 0.0:
        raise RobotError(
            "a box with negative edges",
            got=list(body.torso_box),
            expected="half edges >= 0 m",
            fix="correct them; all 0: the torso touches nothing",
            where=where + ".torso_box",
        )
    if body.contact == "on" and not any((*body.torso_box, body.knee_radius, body.shank_radius)):
        raise RobotError(
            "body contact without a body",
            got="torso_box, knee_radius and shank_radius of 0",
            expected="at least one of them > 0 m",
            fix="give the robot's sizes, or leave body.contact off",
            where=where + ".contact",
        )
    if body.self_contact == "force" and not any((body.knee_radius, body.shank_radius)):
        raise RobotError(
            "forces between legs without a radius",
            got="knee_radius and shank_radius of 0",
            expected="at least one of them > 0 m: they are those of femurs and tibias",
            fix="give the robot's radii, or set body.self_contact to off or warn",
            where=where + ".self_contact",
        )


def _check_static_friction(friction: Friction, where: str) -> None:
    """Checks that static friction is not below kinetic friction and that the law uses it."""
    static, mu = friction.mu_static, friction.mu
    if static in (0.0, mu):
        return
    if static < mu:
        raise RobotError(
            "static friction below kinetic",
            got=static,
            expected=f"at least mu = {mu:g}",
            fix="raise it or leave it out",
            where=where,
        )
    if friction.law not in STATIC_LAWS:
        laws = " or ".join(STATIC_LAWS)
        raise RobotError(
            "static friction that has no effect",
            got=f"{static:g} with the law {friction.law}",
            expected=f"friction.law = {laws}" if laws else f"mu = {mu:g}: no law uses another",
            fix="leave it out" + (f", or choose the law {laws}" if laws else ""),
            where=where,
        )


def _check_stance(robot: Robot, at: str) -> None:
    feet = foot_positions(robot, robot.stance)
    distance, slope = _plane_fit(feet)
    worst = int(np.argmax(np.abs(distance)))
    where = f"{at}legs.{LEG_NAMES[worst]}.stance"
    if abs(distance[worst]) > STANCE_PLANE_TOLERANCE:
        got = f"{distance[worst]:.4g} m off the plane of the other feet"
        raise RobotError(
            "a stance foot does not reach the ground",
            got=got,
            expected=f"at most {STANCE_PLANE_TOLERANCE} m",
            fix="adapt this leg's stance",
            where=where,
        )
    if slope > 0.5:
        raise RobotError(
            "the stance feet do not lie below the torso",
            got=f"slope {slope:.3g}",
            expected="at most 0.5",
            fix="adapt the stance",
            where=at + "legs",
        )
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
