"""Computes energies and momentum of all bodies, T and V of the energy audit (eq. 26), and the
mobility of links and joints.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexapod_cosim.models.actuator import stop_energy
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import constraints
from hexapod_cosim.models.contact.bodies import pair_contacts
from hexapod_cosim.models.contact.forces import (
    candidates,
    contacts_at,
    open_contacts,
    shares_of_feet,
)
from hexapod_cosim.models.dynamics import (
    carrier_speeds,
    joint_overruns,
    mass_matrix,
    masses,
    spin_inertia,
    world_inertias,
)
from hexapod_cosim.models.kinematics import (
    BODIES,
    JOINTS,
    LEGS,
    body_states,
    joint_models,
    joint_speeds,
    rotation_matrix,
)
from hexapod_cosim.models.records import Robot

UNKNOWNS = 6 + LEGS * JOINTS
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def spin_energy(robot: Robot, body: Array) -> float:
    """Returns the part of the kinetic energy by which rotors turn with the bodies (19, 13) that
    carry them, the sum of h s.w_i [J] (eq. 54).
    """
    speeds = carrier_speeds(robot, constraints(robot, body).G) @ body[:, 7:13].ravel()
    return spin_inertia(robot.servo) * float(joint_speeds(robot, body).ravel() @ speeds)


def kinetic_energy(robot: Robot, body: Array) -> float:
    """Returns the kinetic energy [J] of the bodies (19, 13) and the geared rotors."""
    v, w = body[:, 7:10], body[:, 10:13]
    linear = masses(robot) @ np.sum(v * v, axis=1)
    angular = np.einsum("ki,kij,kj->", w, world_inertias(robot, body), w)
    geared = robot.servo.rotor_inertia * np.sum(joint_speeds(robot, body) ** 2)
    return 0.5 * float(linear + angular + geared) + spin_energy(robot, body)


def potential_energy(robot: Robot, body: Array) -> float:
    """Returns the potential energy [J] of gravity, 0 at the world's origin, of the contacts with
    rigid ground, 2/5 w K delta^2.5 each with its share w, of those between legs, and of the
    joints' stops.
    """
    gravity = -float(masses(robot) @ (body[:, 0:3] @ np.array(robot.gravity)))
    open_ = open_contacts(robot)
    contacts = contacts_at(robot, body, open_)
    shares = shares_of_feet(
        robot, list(zip(candidates(robot), open_.states, contacts, strict=True))
    )
    depth = np.array([max(contact.penetration, 0.0) for contact in contacts])
    pairs = np.array([max(contact.penetration, 0.0) for contact in pair_contacts(robot, body)])
    stops = float(np.sum(stop_energy(robot.servo, joint_overruns(robot, body))))
    elastic = float(shares @ depth**2.5) + float(np.sum(pairs**2.5))
    return gravity + 0.4 * robot.contact.stiffness * elastic + stops


def centre_of_mass(robot: Robot, body: Array) -> Array:
    """Returns the centre of mass (3,) of the robot, world axes [m]."""
    return masses(robot) @ body[:, 0:3] / robot.total_mass


def momentum(robot: Robot, body: Array) -> tuple[Array, Array]:
    """Returns linear momentum (3,) [kg m/s] and angular momentum (3,) about the world's origin [kg
    m2/s].

    The spin of the rotors (eq. 54) is included with a gear ratio; without one it is left out.
    """
    linear = masses(robot)[:, None] * body[:, 7:10]
    spin = np.einsum("kij,kj->ki", world_inertias(robot, body), body[:, 10:13])
    about = (np.cross(body[:, 0:3], linear) + spin).sum(axis=0)
    h = spin_inertia(robot.servo) * joint_speeds(robot, body).ravel()
    for joint, size in zip(joint_models(robot), h, strict=True):
        about = about + size * (rotation_matrix(body[joint.parent, 3:7]) @ joint.s_i)
    return linear.sum(axis=0), about


def tibia_mobility(robot: Robot) -> float:
    """Returns the acceleration of the tibias' centres of mass per force there [1/kg], MuJoCo's
    invweight.

    It is the mean over legs and directions, at angle 0.
    """
    J, M = _at_zero(robot)
    tibias = J.reshape(BODIES, 6, UNKNOWNS)[JOINTS::JOINTS, :3].reshape(-1, UNKNOWNS)
    return float(np.mean(np.sum(tibias * np.linalg.solve(M, tibias.T).T, axis=1)))


def joint_mobility(robot: Robot) -> Array:
    """Returns the accelerations (6, 3) of the joints per torque [1/(kg m2)], at angle 0."""
    _, M = _at_zero(robot)
    return np.diag(np.linalg.inv(M))[6:].reshape(LEGS, JOINTS)


def _at_zero(robot: Robot) -> tuple[Array, Array]:
    """Returns the bodies' motion per speed (114, 24) and the mass matrix (24, 24), at angle 0."""
    place, still = np.zeros(3), np.zeros((LEGS, JOINTS))

    def moving(speed: Array) -> Array:
        """Returns bodies (19, 13) at speeds of the torso (6,) and the joints (18,)."""
        torso, joints = (speed[:3], speed[3:6]), speed[6:].reshape(LEGS, JOINTS)
        return body_states(robot, place, UPRIGHT, *torso, still, joints)

    J = np.stack([moving(speed)[:, 7:13].ravel() for speed in np.eye(UNKNOWNS)], axis=-1)
    plain = replace(robot, servo=replace(robot.servo, gear_ratio=0.0))
    return J, np.asarray(J.T @ mass_matrix(plain, moving(np.zeros(UNKNOWNS))) @ J)
