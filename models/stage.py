"""Computes a stage of the integrator (eq. 20) with dense matrices.

The fast form is plant_fmu/src/lanes/stage.h.

A linearly implicit stage solves eq. 1 with the stiff part of the forces evaluated at the end of the
stage. With z = 0 it is eq. 1 itself, the stage of an explicit method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.actuator import gear_drag, servo_slopes, stop_slopes
from hexapod_cosim.models.body.contacts import body_spheres
from hexapod_cosim.models.body.slopes import BodySlopes, body_slope_matrices
from hexapod_cosim.models.contact import (
    contact_jacobian,
    contact_matrices,
    foot_contacts,
    normal_force,
    normal_slopes,
    slip_velocity,
)
from hexapod_cosim.models.dynamics import (
    Command,
    applied_forces,
    constraint_equations,
    constraints,
    joint_overruns,
    joint_torques,
    mass_matrix,
    solve_constrained,
    stop_torques,
)
from hexapod_cosim.models.friction import bristle_rate, bristle_slopes, turning_slopes
from hexapod_cosim.models.kinematics import (
    BODIES,
    JOINTS,
    LEGS,
    joint_angles,
    joint_speeds,
)
from hexapod_cosim.models.records import BRISTLE_LAWS, Array, Robot


@dataclass(frozen=True)
class Slopes:
    """Derivatives of the forces that W uses; those of the step's first stage."""

    motor_stiffness: Array  # (6, 3) N m/rad
    motor_damping: Array  # (6, 3) N m s/rad
    gear_drag: Array  # (6, 3) N m s/rad
    stiffness: Array  # (6,) N/m    of the normal force by delta
    viscosity: Array  # (6,) N s/m  of the normal force by ddelta
    drag: Array  # (6,) N s/m  of friction by slip velocity; bristles: by their rate
    bristle: Array  # (6,) N/m    of friction by the bristles' deflection, -G_b
    beta: Array  # (6,) 1/s    release rate of sliding bristles
    spin: Array  # (6,) N m s  of the foot's moment by angular velocity, about the normal
    roll: Array  # (6,) N m s  the same across the normal
    stop_stiffness: Array  # (6, 3) N m/rad
    stop_damping: Array  # (6, 3) N m s/rad


@dataclass(frozen=True)
class StageRate:
    """k/h of a stage: rates of positions, velocities and bristles."""

    nu: Array  # (114,)  m/s and rad/s, body by body
    alpha: Array  # (114,)  m/s2 and rad/s2
    bristle: Array  # (6, 3)  m/s


def keep_slopes(
    robot: Robot,
    body: Array,
    bristle: Array,
    command: Command,
    damping: Array,
    ahead: float,
) -> Slopes:
    """Returns the derivatives of the forces at bodies (19, 13) and bristles (6, 3).

    The contact's are taken at delta + ahead max(ddelta, 0), because a foot that has just touched
    down has neither depth nor derivatives yet, and W would miss its contact. damping: (6,) of the
    contacts [s/m], nan for open feet.
    """
    angle, speed = joint_angles(robot, body), joint_speeds(robot, body)
    references = (command.angle_ref, command.speed_ref, command.torque_ref)
    motor_stiffness, motor_damping = servo_slopes(robot.servo, angle, speed, *references)
    feet = []
    for leg, foot in enumerate(foot_contacts(robot, body)):
        deeper = foot.penetration + ahead * max(foot.approach_speed, 0.0)
        f_n = normal_force(robot.contact, damping[leg], deeper, foot.approach_speed)
        normal = normal_slopes(robot.contact, damping[leg], deeper, foot.approach_speed)
        along = bristle_slopes(robot.friction, slip_velocity(foot), bristle[leg])
        turn = body[JOINTS * (leg + 1), 10:13]
        spin, roll = turning_slopes(robot.friction, robot.foot.radius, foot.normal, turn)
        friction = [along.damping, along.stiffness, spin, roll]
        feet.append([*normal, *(f_n * np.array(friction)), along.beta])
    stiffness, viscosity, drag, spring, spins, rolls, beta = np.array(feet).T
    contacts = (stiffness, viscosity, drag, spring, beta, spins, rolls)
    stops = stop_slopes(robot.servo, joint_overruns(robot, body), speed)
    return Slopes(motor_stiffness, motor_damping, gear_drag(robot.servo, speed), *contacts, *stops)


def slope_matrices(robot: Robot, body: Array, slopes: Slopes) -> tuple[Array, Array]:
    """Returns G_x and G_v of eq. 20, each (114, 114), at bodies (19, 13).

    They consist of servos, gears and stops on the joints' axes, of each contact along its normal n
    and, by its drag alone, across it, and of the moments of spin and rolling on the tibia.
    """
    G = constraints(robot, body).G
    damping = slopes.motor_damping + slopes.gear_drag + slopes.stop_damping
    G_x = -G.T @ ((slopes.motor_stiffness + slopes.stop_stiffness).reshape(-1, 1) * G)
    G_v = -G.T @ (damping.reshape(-1, 1) * G)
    for leg, foot in enumerate(foot_contacts(robot, body)):
        by_x, by_v = contact_matrices(
            contact_jacobian(body, JOINTS * (leg + 1), foot),
            foot.normal,
            stiffness=slopes.stiffness[leg],
            viscosity=slopes.viscosity[leg],
            drag=slopes.drag[leg],
        )
        G_x += by_x
        G_v += by_v
        nn = np.outer(foot.normal, foot.normal)
        turn = slice(6 * JOINTS * (leg + 1) + 3, 6 * JOINTS * (leg + 1) + 6)
        G_v[turn, turn] -= slopes.spin[leg] * nn + slopes.roll[leg] * (np.eye(3) - nn)
    return G_x, G_v


def law_bristle_rates(robot: Robot, body: Array, bristle: Array, damping: Array) -> Array:
    """Returns db/dt (6, 3) of the friction law [m/s]; 0 for open feet and without bristles."""
    rate = np.zeros((LEGS, 3))
    for leg, foot in enumerate(foot_contacts(robot, body)):
        if not np.isnan(damping[leg]):
            rate[leg] = bristle_rate(robot.friction, slip_velocity(foot), bristle[leg])
    return rate


def tangential_jacobians(robot: Robot, body: Array) -> list[Array]:
    """Returns (1 - n n^T) J of each foot (3, 114): the speed of its contact across the normal."""
    found = []
    for leg, foot in enumerate(foot_contacts(robot, body)):
        nn = np.outer(foot.normal, foot.normal)
        found.append((np.eye(3) - nn) @ contact_jacobian(body, JOINTS * (leg + 1), foot))
    return found


def solve_stage(
    robot: Robot,
    body: Array,
    bristle: Array,
    command: Command,
    damping: Array,
    slopes: Slopes,
    z: float,
    change: tuple[Array, Array, Array],
    touching: tuple[Array, BodySlopes] | None = None,
) -> StageRate:
    """Solves eq. 20 at bodies (19, 13) and bristles (6, 3) with dense matrices.

    Args:
        robot, command: as in `accelerations`.
        body, bristle: y_i of the stage.
        damping: (6,) of the contacts [s/m], nan for open feet.
        slopes: those of the step's first stage.
        z: h gamma [s]; 0 for explicit methods.
        change: s_x (114,), s_v (114,) and s_b (6, 3), the sums of g_ij k_j over earlier stages.
        touching: damping of the contacts of torso, knees and shanks, and their slopes in the step's
            first stage; None: all open.
    """
    s_x, s_v, s_b = change
    v, G = body[:, 7:13].ravel(), constraints(robot, body).G
    G_x, G_v = slope_matrices(robot, body, slopes)
    if touching is not None:
        body_x, body_v = body_slope_matrices(robot, body, touching[1])
        G_x, G_v = G_x + body_x, G_v + body_v
    rate = law_bristle_rates(robot, body, bristle, damping)

    # W = M - z G_v - z^2 G_x;  right = g + G_v s_v + G_x (s_x + z (v + s_v))
    motor, gear = joint_torques(robot, body, command)
    held = np.full(len(body_spheres(robot)), np.nan) if touching is None else touching[0]
    g = applied_forces(robot, body, command, damping, bristle, held).ravel()
    g += G.T @ (motor + gear + stop_torques(robot, body)).ravel()
    W = mass_matrix(robot, body) - z * G_v - z * z * G_x
    right = g + G_v @ s_v + G_x @ (s_x + z * (v + s_v))

    # bristles: a spring across the normal, -G_b/(1 + z beta), stretched by s_b + z (db/dt + s_v)
    along = tangential_jacobians(robot, body)
    for leg, T in enumerate(along):
        spring = slopes.bristle[leg] / (1.0 + z * slopes.beta[leg])
        W += z * z * spring * T.T @ T
        right -= spring * T.T @ (s_b[leg] + z * (rate[leg] + T @ s_v))
    # [W  D^T; D  0] [alpha; lambda] = [right; c]
    D, c = constraint_equations(robot, body, command)
    alpha = solve_constrained(W, right, D, c)[: 6 * BODIES]

    # nu = v + s_v + z alpha;  k_b/h = (db/dt + s_v + z alpha - beta s_b)/(1 + z beta)
    for leg, T in enumerate(along):
        if not np.isnan(damping[leg]) and robot.friction.law in BRISTLE_LAWS:
            beta = slopes.beta[leg]
            moved = rate[leg] + T @ (s_v + z * alpha) - beta * s_b[leg]
            rate[leg] = moved / (1.0 + z * beta)
    return StageRate(v + s_v + z * alpha, alpha, rate)
