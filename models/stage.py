"""Computes a stage of the integrator (eq. 20) with dense matrices.

The fast form is plant_fmu/src/lanes/stage.h.

A linearly implicit stage solves eq. 1 with the stiff part of the forces evaluated at the end of the
stage. With z = 0 it is eq. 1 itself, the stage of an explicit method.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hexapod_cosim.models.actuator import gear_drag, servo_slopes, servo_torque, stop_slopes
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import constraints
from hexapod_cosim.models.contact.forces import (
    Candidate,
    Contacts,
    closed_contacts,
    contact_bristle_rate,
)
from hexapod_cosim.models.contact.geometry import (
    FootContact,
    contact_jacobian,
    contact_matrices,
    slip_velocity,
    turning_slopes,
)
from hexapod_cosim.models.contact.law import ContactState, normal_force, normal_slopes
from hexapod_cosim.models.dynamics import (
    Command,
    applied_forces,
    constraint_equations,
    external_torques,
    gear_loads,
    joint_overruns,
    joint_torques,
    mass_matrix,
    solve_constrained,
    stop_torques,
)
from hexapod_cosim.models.friction import friction_drag, friction_grip
from hexapod_cosim.models.kinematics import BODIES, JOINTS, LEGS, joint_angles, joint_speeds
from hexapod_cosim.models.records import Robot
from hexapod_cosim.models.servos.motor import has_measured_friction, measured_drag
from hexapod_cosim.models.soil.law import shear_limit, soil_normal_force, soil_normal_slopes


@dataclass(frozen=True)
class ContactSlopes:
    """Derivatives of the forces of one contact."""

    stiffness: float  # N/m    of the normal force by delta
    viscosity: float  # N s/m  of the normal force by ddelta
    drag: float  # N s/m  of friction by slip velocity; bristles: by their rate
    bristle: float = 0.0  # N/m    of friction by the bristles' deflection, -G_b
    relaxation: float = 0.0  # 1/s    beta of eq. 21
    spin: float = 0.0  # N m s  of the foot's moment by angular velocity, about the normal
    roll: float = 0.0  # N m s  the same across the normal


@dataclass(frozen=True)
class Slopes:
    """Derivatives of the forces that W uses; those of the step's first stage."""

    motor_stiffness: Array  # (6, 3) N m/rad
    motor_damping: Array  # (6, 3) N m s/rad
    gear_drag: Array  # (6, 3) N m s/rad
    stop_stiffness: Array  # (6, 3) N m/rad
    stop_damping: Array  # (6, 3) N m s/rad
    contact: Mapping[int, ContactSlopes]  # of closed contacts, by their number


@dataclass(frozen=True)
class StageRate:
    """k/h of a stage: rates of positions, velocities and bristles."""

    nu: Array  # (114,)  m/s and rad/s, body by body
    alpha: Array  # (114,)  m/s2 and rad/s2
    bristle: Array  # (6, 3)  m/s


def keep_slopes(
    robot: Robot, body: Array, bristle: Array, command: Command, contacts: Contacts, ahead: float
) -> Slopes:
    """Returns the derivatives of the forces at bodies (19, 13) and bristles (6, 3).

    The contacts' are taken at delta + ahead max(ddelta, 0), because a foot that has just touched
    down has neither depth nor derivatives yet, and W would miss its contact.
    """
    angle, speed = joint_angles(robot, body), joint_speeds(robot, body)
    references = (command.angle_ref, command.speed_ref, command.torque_ref)
    motor = servo_slopes(robot.servo, angle, speed, *references, power=command.power)
    stops = stop_slopes(robot.servo, joint_overruns(robot, body), speed)
    found = {}
    for k, point, state, contact in closed_contacts(robot, body, contacts):
        w = body[point.sphere.body, 10:13]
        if state.is_soft:
            found[k] = soil_slopes(robot, state, float(contacts.plastic[k]), contact, ahead)
        else:
            deflection = bristle[point.leg] if point.is_sole else np.zeros(3)
            found[k] = rigid_slopes(robot, point, state, contact, deflection, w, ahead)
    drag = gear_drag(robot.servo, speed)
    if has_measured_friction(robot.servo):
        forces = applied_forces(robot, body, command, contacts, bristle).ravel()
        load = external_torques(robot, body, command, forces, constraints(robot, body))
        kinematic = robot.servo.mode == "kinematic"
        torque = (
            -load
            if kinematic
            else servo_torque(robot.servo, angle, speed, *references, power=command.power)
        )
        drag = measured_drag(robot.servo, speed, torque, load)
    return Slopes(*motor, drag, *stops, found)


def expected_depth(contact: FootContact, ahead: float) -> float:
    """Returns the depth [m] that a contact reaches after a time [s]."""
    return contact.penetration + ahead * max(contact.approach_speed, 0.0)


def rigid_slopes(
    robot: Robot,
    point: Candidate,
    state: ContactState,
    contact: FootContact,
    bristle: Array,
    w: Array,
    ahead: float,
) -> ContactSlopes:
    """Returns the derivatives of a contact with rigid ground.

    bristle: deflection (3,) of a sole [m]; w: angular velocity (3,) of the body [rad/s].
    """
    at = (state.contact, state.damping, expected_depth(contact, ahead), contact.approach_speed)
    f_n, (stiffness, viscosity) = normal_force(*at), normal_slopes(*at)
    slip, friction = slip_velocity(contact), state.friction
    if not point.is_sole:
        along = f_n * friction_drag(friction, float(np.linalg.norm(slip)))
        slopes = ContactSlopes(stiffness, viscosity, along)
    else:
        b = friction_grip(friction, f_n, slip, bristle)
        drag, spring = f_n * b.damping, f_n * b.stiffness
        slopes = ContactSlopes(stiffness, viscosity, drag, spring, b.relaxation)
    if point.leg < 0:
        return slopes
    spin, roll = turning_slopes(friction, robot.foot.radius, contact.normal, w)
    return replace(slopes, spin=f_n * spin, roll=f_n * roll)


def soil_slopes(
    robot: Robot, state: ContactState, plastic: float, contact: FootContact, ahead: float
) -> ContactSlopes:
    """Returns the derivatives of a foot on soil at plastic depth z_p [m]; its moments have none."""
    soil, foot, depth = state.soil, robot.foot, expected_depth(contact, ahead)
    at = (soil, foot, plastic, depth, contact.approach_speed)
    limit = shear_limit(soil, foot, max(depth, plastic), soil_normal_force(*at))
    yielding = float(np.linalg.norm(slip_velocity(contact))) / soil.shear_displacement
    shear = limit / soil.shear_displacement
    return ContactSlopes(*soil_normal_slopes(*at), drag=0.0, bristle=shear, relaxation=yielding)


def slope_matrices(
    robot: Robot, body: Array, contacts: Contacts, slopes: Slopes, G: Array
) -> tuple[Array, Array]:
    """Returns G_x and G_v of eq. 20, each (114, 114), at bodies (19, 13).

    G: (18, 114) as in `Constraints`. They consist of servos, gears and stops on the joints' axes,
    of each contact along its normal n and, by its drag alone, across it, and of the moments of spin
    and rolling on the tibia.
    """
    damping = slopes.motor_damping + slopes.gear_drag + slopes.stop_damping
    stiffness = slopes.motor_stiffness + slopes.stop_stiffness
    G_x = -G.T @ (stiffness.reshape(-1, 1) * G)
    G_v = -G.T @ (damping.reshape(-1, 1) * G)
    for k, point, _, contact in closed_contacts(robot, body, contacts):
        law = slopes.contact[k]
        by_x, by_v = contact_matrices(
            contact_jacobian(body, point.sphere.body, contact),
            contact.normal,
            stiffness=law.stiffness,
            viscosity=law.viscosity,
            drag=law.drag,
        )
        G_x += by_x
        G_v += by_v
        nn = np.outer(contact.normal, contact.normal)
        angular = slice(6 * point.sphere.body + 3, 6 * point.sphere.body + 6)
        G_v[angular, angular] -= law.spin * nn + law.roll * (np.eye(3) - nn)
    return G_x, G_v


@dataclass(frozen=True)
class SoleBristles:
    """Bristles of a closed sole in a stage."""

    leg: int
    T: Array  # (3, 114)  (1 - n n^T) J: the speed of its contact across the normal
    rate: Array  # (3,) m/s  db/dt of the law
    law: ContactSlopes


def sole_bristles(
    robot: Robot, body: Array, bristle: Array, contacts: Contacts, slopes: Slopes
) -> list[SoleBristles]:
    """Returns the bristles of all closed soles that have some."""
    found = []
    for k, point, state, contact in closed_contacts(robot, body, contacts):
        if point.is_sole and state.has_bristles:
            across = np.eye(3) - np.outer(contact.normal, contact.normal)
            T = across @ contact_jacobian(body, point.sphere.body, contact)
            rate = contact_bristle_rate(state, contact, bristle[point.leg])
            found.append(SoleBristles(point.leg, T, rate, slopes.contact[k]))
    return found


def solve_stage(
    robot: Robot,
    body: Array,
    bristle: Array,
    command: Command,
    contacts: Contacts,
    slopes: Slopes,
    z: float,
    change: tuple[Array, Array, Array],
) -> StageRate:
    """Solves eq. 20 at bodies (19, 13) and bristles (6, 3) with dense matrices.

    Args:
        robot, command: as in `accelerations`.
        body, bristle: y_i of the stage.
        contacts: the state of all contacts.
        slopes: those of the step's first stage.
        z: h gamma [s]; 0 for explicit methods.
        change: s_x (114,), s_v (114,) and s_b (6, 3), the sums of g_ij k_j over earlier stages.
    """
    s_x, s_v, s_b = change
    v, joints = body[:, 7:13].ravel(), constraints(robot, body)
    G = joints.G
    G_x, G_v = slope_matrices(robot, body, contacts, slopes, G)

    # W = M - z G_v - z^2 G_x;  right = g + G_v s_v + G_x (s_x + z (v + s_v))
    g = applied_forces(robot, body, command, contacts, bristle).ravel()
    load = gear_loads(robot, body, command, g, joints)
    motor, gear = joint_torques(robot, body, command, load)
    g += G.T @ (motor + gear + stop_torques(robot, body)).ravel()
    W = mass_matrix(robot, body, joints) - z * G_v - z * z * G_x
    right = g + G_v @ s_v + G_x @ (s_x + z * (v + s_v))

    # bristles: a spring across the normal, -G_b/(1 + z beta), stretched by s_b + z (db/dt + s_v)
    soles = sole_bristles(robot, body, bristle, contacts, slopes)
    for sole in soles:
        spring = sole.law.bristle / (1.0 + z * sole.law.relaxation)
        W += z * z * spring * sole.T.T @ sole.T
        right -= spring * sole.T.T @ (s_b[sole.leg] + z * (sole.rate + sole.T @ s_v))
    # [W  D^T; D  0] [alpha; lambda] = [right; c]
    D, c = constraint_equations(robot, body, command, joints)
    alpha = solve_constrained(W, right, D, c)[: 6 * BODIES]

    # nu = v + s_v + z alpha;  k_b/h = (db/dt + s_v + z alpha - beta s_b)/(1 + z beta)
    rate = np.zeros((LEGS, JOINTS))
    for sole in soles:
        moved = sole.rate + sole.T @ (s_v + z * alpha) - sole.law.relaxation * s_b[sole.leg]
        rate[sole.leg] = moved / (1.0 + z * sole.law.relaxation)
    return StageRate(v + s_v + z * alpha, alpha, rate)
