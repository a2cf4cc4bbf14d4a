"""Solves the equations of motion (eq. 1) with dense matrices, as the reference of the C plant.

[ M  D^T ] [ dv     ]   [ g                                    ]
[ D  0   ] [ lambda ] = [ gamma - 2 alpha dPhi - beta^2 Phi    ]     (eq. 1)

The C plant solves the same system in O(n). D, gamma, Phi and dPhi (eq. 2-4) are in constraints.py.
Velocities are stacked body by body, v then w, world axes: 19 x 6 = 114.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hexapod_cosim.models.actuator import gear_friction, overrun, servo_torque, stop_torque
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import MULTIPLIERS, Constraints, constraints
from hexapod_cosim.models.contact.bodies import standing_body_damping, standing_pairs
from hexapod_cosim.models.contact.forces import Contacts, contact_wrenches, contacts_of
from hexapod_cosim.models.kinematics import (
    BODIES,
    JOINTS,
    LEGS,
    cross,
    inertia_matrix,
    joint_angles,
    joint_models,
    joint_speeds,
    rotation_matrix,
)
from hexapod_cosim.models.records import Robot, Servo
from hexapod_cosim.models.servos.motor import FULL, Power, has_measured_friction, measured_friction


@dataclass(frozen=True, kw_only=True)
class Command:
    """Inputs of the robot.

    Arrays of joints are (6, 3), leg by leg; vectors (3,) are in world axes at the torso's centre of
    mass.
    """

    angle_ref: Array  # rad
    speed_ref: Array = field(default_factory=lambda: np.zeros((LEGS, JOINTS)))  # rad/s
    torque_ref: Array = field(default_factory=lambda: np.zeros((LEGS, JOINTS)))  # N m
    push_force: Array = field(default_factory=lambda: np.zeros(3))  # N
    push_torque: Array = field(default_factory=lambda: np.zeros(3))  # N m
    # rad/s2, of kinematic drives only
    acceleration_ref: Array = field(default_factory=lambda: np.zeros((LEGS, JOINTS)))
    power: Power = FULL  # of the motors; shares of limits (6, 3)
    age: float = 0.0  # s  time since the command; kinematic drives extrapolate (eq. 13)


def masses(robot: Robot) -> Array:
    """Returns the masses (19,) of the bodies [kg]."""
    return np.array([robot.torso.mass, *(link.mass for leg in robot.legs for link in leg.links)])


def world_inertias(robot: Robot, body: Array) -> Array:
    """Returns the inertias J = R_WB J_B R_WB^T (19, 3, 3), world axes [kg m2]."""
    local = [robot.torso.inertia, *(link.inertia for leg in robot.legs for link in leg.links)]
    R = [rotation_matrix(state[3:7]) for state in body]
    return np.array(
        [R_WB @ inertia_matrix(J_B) @ R_WB.T for R_WB, J_B in zip(R, local, strict=True)]
    )


def mass_matrix(robot: Robot, body: Array, joints: Constraints | None = None) -> Array:
    """Returns M = diag(m 1, J) + J_r G^T G (114, 114).

    The inertia J_r of the geared rotors acts on the joint speeds; with a gear ratio n it also
    couples them to the bodies that carry the rotors, J_r/n (G^T P + P^T G) (eq. 54). joints:
    `constraints` at these bodies, if they are known.
    """
    M = np.zeros((6 * BODIES, 6 * BODIES))
    for k, (mass, J) in enumerate(zip(masses(robot), world_inertias(robot, body), strict=True)):
        M[6 * k : 6 * k + 3, 6 * k : 6 * k + 3] = mass * np.eye(3)
        M[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = J
    G = (joints or constraints(robot, body)).G
    P, spin = carrier_speeds(robot, G), spin_inertia(robot.servo)
    return M + robot.servo.rotor_inertia * G.T @ G + spin * (G.T @ P + P.T @ G)


def carrier_speeds(robot: Robot, G: Array) -> Array:
    """Returns P (18, 114): P v are the speeds s.w_i at which the bodies that carry the rotors turn
    about the joints' axes.

    G: as in `Constraints`.
    """
    P = np.zeros_like(G)
    for k, joint in enumerate(joint_models(robot)):
        parent = slice(6 * joint.parent, 6 * joint.parent + 6)
        P[k, parent] = -G[k, parent]
    return P


def spin_inertia(servo: Servo) -> float:
    """Returns the inertia of a rotor times its gear ratio, J_r/n [kg m2] (eq. 54); 0: left out."""
    return servo.rotor_inertia / servo.gear_ratio if servo.gear_ratio != 0.0 else 0.0


def rotor_moments(robot: Robot, body: Array) -> Array:
    """Returns the moments (19, 3) of the rotors on the bodies that carry them, -h w_i x s [N m].

    h is the angular momentum J_r/n times the speed of the rotor, about the joint's axis (eq. 54).
    """
    moments = np.zeros((BODIES, 3))
    spin = spin_inertia(robot.servo) * joint_speeds(robot, body).ravel()
    for joint, h in zip(joint_models(robot), spin, strict=True):
        R_Wi = rotation_matrix(body[joint.parent, 3:7])
        s = R_Wi @ joint.s_i
        moments[joint.parent] -= h * cross(body[joint.parent, 10:13], s)
    return moments


def applied_forces(
    robot: Robot,
    body: Array,
    command: Command,
    damping: Array | Contacts,
    bristle: Array | None = None,
) -> Array:
    """Returns the forces g (19, 6) of eq. 1 without the joints' torques [N, N m].

    damping: of the feet on the ground below them (6,) [s/m], nan for open ones; or the state of all
    contacts, which has those of walls, materials and soil, too. With an array, parts of the body
    in the ground and legs that overlap touch at impact speed 0. bristle: deflections (6, 3) [m], 0
    by default.
    """
    if not isinstance(damping, Contacts):
        closed = contacts_of(robot, damping, standing_body_damping(robot, body))
        damping = replace(closed, pairs=standing_pairs(robot, body))
    g = np.zeros((BODIES, 6))
    g[:, 0:3] = masses(robot)[:, None] * np.array(robot.gravity)
    J, w = world_inertias(robot, body), body[:, 10:13]
    g[:, 3:6] = -np.cross(w, np.einsum("kij,kj->ki", J, w))
    if spin_inertia(robot.servo) != 0.0:
        g[:, 3:6] += rotor_moments(robot, body)
    g[0] += np.concatenate([command.push_force, command.push_torque])
    return g + contact_wrenches(robot, body, damping, bristle)


def joint_torques(
    robot: Robot, body: Array, command: Command, external: Array | None = None
) -> tuple[Array, Array]:
    """Returns motor torque (6, 3) and friction (6, 3) on the child [N m].

    The motor torque is 0 in kinematic mode, where it is a multiplier; measured friction is then
    that of a motor which balances the external torque. external: (6, 3) as of
    `external_torques`, for gears whose friction depends on the load; None: 0.
    """
    servo = robot.servo
    angle, speed = joint_angles(robot, body), joint_speeds(robot, body)
    load = np.zeros_like(angle) if external is None else external
    measured = has_measured_friction(servo)
    if servo.mode == "kinematic":
        balanced = (servo, speed, -load, load)
        gear = measured_friction(*balanced) if measured else gear_friction(servo, speed)
        return np.zeros_like(gear), gear
    references = (command.angle_ref, command.speed_ref, command.torque_ref)
    motor = servo_torque(servo, angle, speed, *references, power=command.power)
    if not measured:
        return motor, gear_friction(servo, speed)
    return motor, measured_friction(servo, speed, motor, load)


def external_torques(
    robot: Robot, body: Array, command: Command, forces: Array, joints: Constraints
) -> Array:
    """Returns the torques (6, 3) of all but motors and gears on the joints [N m] (eq. 51).

    forces: g (114,) of eq. 1 without the joints' torques. The torques are those that the joints
    would have to resist if neither the torso nor any joint accelerated: gravity, ground,
    centrifugal and Coriolis terms, and the joint's own stops. Joints of kinematic drives
    accelerate as they are driven.
    """
    alpha, beta = robot.baumgarte.alpha, robot.baumgarte.beta
    c = joints.gamma - 2.0 * alpha * joints.dphi - beta**2 * joints.phi
    torso = np.eye(6, 6 * BODIES)
    fixed = np.vstack([torso, joints.D, joints.G])
    none, unit = np.zeros((6 + len(c), LEGS * JOINTS)), np.eye(LEGS * JOINTS)
    motion = np.linalg.solve(fixed, np.vstack([none, unit]))  # of the links with each joint
    kinematic = robot.servo.mode == "kinematic"
    driven = drive_acceleration(robot, body, command).ravel() if kinematic else unit[0] * 0.0
    bias = np.linalg.solve(fixed, np.concatenate([np.zeros(6), c, driven]))
    links = replace(robot, servo=replace(robot.servo, rotor_inertia=0.0))
    load = motion.T @ (forces - mass_matrix(links, body, joints) @ bias)
    return load.reshape(LEGS, JOINTS) + stop_torques(robot, body)


def gear_loads(
    robot: Robot, body: Array, command: Command, forces: Array, joints: Constraints
) -> Array | None:
    """Returns the `external_torques`, None for gears whose friction does not depend on them."""
    if not has_measured_friction(robot.servo):
        return None
    return external_torques(robot, body, command, forces, joints)


def joint_overruns(robot: Robot, body: Array) -> Array:
    """Returns how far joints are past their stops (6, 3) [rad]."""
    return overrun(joint_angles(robot, body), robot.angle_min, robot.angle_max)


def stop_torques(robot: Robot, body: Array) -> Array:
    """Returns the torques (6, 3) of the stops on the child [N m]; 0 in kinematic mode."""
    return stop_torque(robot.servo, joint_overruns(robot, body), joint_speeds(robot, body))


def drive_acceleration(robot: Robot, body: Array, command: Command) -> Array:
    """Returns the acceleration s.(dw_j - dw_i) (6, 3) of kinematic drives [rad/s2] (eq. 13).

    The drives follow q_ref + qd_ref s + qdd_ref s^2/2, s the command's age, with Baumgarte terms.
    """
    alpha, beta, age = robot.baumgarte.alpha, robot.baumgarte.beta, command.age
    speed_ref = command.speed_ref + command.acceleration_ref * age
    angle_ref = (
        command.angle_ref + command.speed_ref * age + 0.5 * command.acceleration_ref * age**2
    )
    error = joint_angles(robot, body) - angle_ref
    return (
        command.acceleration_ref
        - 2.0 * alpha * (joint_speeds(robot, body) - speed_ref)
        - beta**2 * error
    )


def constraint_equations(
    robot: Robot, body: Array, command: Command, joints: Constraints | None = None
) -> tuple[Array, Array]:
    """Returns D and c of the rows D dv = c of eq. 1 (c: eq. 7) at bodies (19, 13).

    In kinematic mode each joint adds the row G dv = drive_acceleration (eq. 13). joints: as in
    `mass_matrix`.
    """
    joints = joints or constraints(robot, body)
    c = (
        joints.gamma
        - 2.0 * robot.baumgarte.alpha * joints.dphi
        - robot.baumgarte.beta**2 * joints.phi
    )
    if robot.servo.mode != "kinematic":
        return joints.D, c
    drive = drive_acceleration(robot, body, command).ravel()
    return np.vstack([joints.D, joints.G]), np.concatenate([c, drive])


def solve_constrained(W: Array, right: Array, D: Array, c: Array) -> Array:
    """Solves [W D^T; D 0] [dv; lambda] = [right; c]. Returns dv, then the multipliers."""
    none = np.zeros((len(c), len(c)))
    return np.linalg.solve(np.block([[W, D.T], [D, none]]), np.concatenate([right, c]))


@dataclass(frozen=True)
class Accelerations:
    """The solution of eq. 1."""

    dv: Array  # (19, 6)  m/s2 then rad/s2
    multipliers: Array  # (18, 5)  lambda
    drive_torque: Array  # (6, 3)  motor on child [N m]; in kinematic mode the drive's multiplier
    gear_torque: Array  # (6, 3)  gear on child [N m]


def accelerations(
    robot: Robot,
    body: Array,
    command: Command,
    damping: Array | Contacts,
    bristle: Array | None = None,
) -> Accelerations:
    """Solves eq. 1 for bodies (19, 13), whose joints may have drifted.

    damping and bristle are those of `applied_forces`. In kinematic mode the multiplier of a joint's
    additional row is minus the motor's torque.
    """
    joints = constraints(robot, body)
    forces = applied_forces(robot, body, command, damping, bristle).ravel()
    load = gear_loads(robot, body, command, forces, joints)
    motor, gear = joint_torques(robot, body, command, load)
    D, c = constraint_equations(robot, body, command, joints)
    g = forces + joints.G.T @ (motor + gear + stop_torques(robot, body)).ravel()
    solution = solve_constrained(mass_matrix(robot, body, joints), g, D, c)
    dv, multiplier, drive = np.split(solution, [6 * BODIES, 6 * BODIES + len(joints.phi)])
    motor = -drive.reshape(LEGS, JOINTS) if robot.servo.mode == "kinematic" else motor
    multipliers = multiplier.reshape(-1, MULTIPLIERS)
    return Accelerations(dv.reshape(BODIES, 6), multipliers, motor, gear)
