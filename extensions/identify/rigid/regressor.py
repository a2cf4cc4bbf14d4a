"""Writes the equations of motion of the robot as linear functions of its inertial parameters.

The 24 equations of a sample are the force (3) and the moment about the torso's origin (3) that the
ground exerts on the robot, in torso axes, and the 18 torques of the joints. A body with mass m,
centre of mass c and inertia I about its origin has the parameters
phi = (m, m c, I_xx, I_yy, I_zz, I_xy, I_xz, I_yz), for which f = m a + dw x mc + w x (w x mc) and
n = I dw + w x I w + mc x a, with the proper acceleration a of the origin. So both are linear in phi
(Atkeson, An and Hollerbach, Estimation of inertial parameters of manipulator loads and links,
International Journal of Robotics Research 1986). An origin is that of the torso's frame, or the
joint of a link.

Letters of frames: W world, T torso, L link. Arrays begin with the samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models import Robot
from hexapod_cosim.models.kinematics import (
    BODIES,
    JOINTS,
    LEGS,
    axis_rotation,
    inertia_matrix,
    skew,
    unit_axis,
)
from hexapod_cosim.models.records import Link, Torso

Array = NDArray[np.float64]
EQUATIONS = 6 + LEGS * JOINTS
PARAMETERS = 10  # of a body
GROUPS = 1 + JOINTS  # torso, and the links of all legs
ORDER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx yy zz xy xz yz


@dataclass(frozen=True)
class Motion:
    """Motion of a robot at some instants; vectors are in torso axes."""

    angle: Array  # (samples, 6, 3) rad
    speed: Array  # (samples, 6, 3) rad/s
    acceleration: Array  # (samples, 6, 3) rad/s2
    spin: Array  # (samples, 3) rad/s    w of the torso
    spin_rate: Array  # (samples, 3) rad/s2   dw of the torso
    lift: Array  # (samples, 3) m/s2   acceleration of the torso's origin less gravity
    turn: Array  # (samples, 3, 3)     R_WT


@dataclass(frozen=True)
class Frame:
    """Motion of a body's frame; vectors are in torso axes."""

    turn: Array  # (samples, 3, 3) R_TL
    origin: Array  # (samples, 3) from the torso's origin [m]
    spin: Array  # (samples, 3)
    spin_rate: Array  # (samples, 3)
    lift: Array  # (samples, 3)
    axis: Array | None = None  # (samples, 3) of the joint; None: the torso


def frames(robot: Robot, motion: Motion) -> list[Frame]:
    """Returns the frames of the 19 bodies, leg by leg."""
    count = len(motion.spin)
    torso = Frame(
        turn=np.broadcast_to(np.eye(3), (count, 3, 3)),
        origin=np.zeros((count, 3)),
        spin=motion.spin,
        spin_rate=motion.spin_rate,
        lift=motion.lift,
    )
    found = [torso]
    for leg, data in enumerate(robot.legs):
        parent, place = torso, np.array(data.hip_position)
        zero = axis_rotation(np.array([0.0, 0.0, 1.0]), data.hip_yaw)
        for joint, link in enumerate(data.links):
            each = (
                motion.angle[:, leg, joint],
                motion.speed[:, leg, joint],
                motion.acceleration[:, leg, joint],
            )
            parent = _child(parent, place, parent.turn @ zero, unit_axis(link.axis), each)
            found.append(parent)
            place, zero = np.array(link.tip), np.eye(3)
    return found


def _child(
    parent: Frame, place: Array, zero: Array, axis: Array, each: tuple[Array, Array, Array]
) -> Frame:
    """Returns the frame of a link.

    place: its joint in the parent's frame (3,) [m]. zero: its axes at angle 0 (samples, 3, 3).
    axis: of the joint, in these (3,). each: angle, speed and acceleration (samples,).
    """
    angle, speed, acceleration = each
    arm = parent.turn @ place
    own = zero @ axis
    spin = parent.spin + speed[:, None] * own
    rate = np.cross(parent.spin, own)
    return Frame(
        turn=zero @ _rotations(axis, angle),
        origin=parent.origin + arm,
        spin=spin,
        spin_rate=parent.spin_rate + acceleration[:, None] * own + speed[:, None] * rate,
        lift=point_lift(parent, arm),
        axis=own,
    )


def point_lift(frame: Frame, arm: Array) -> Array:
    """Returns the proper acceleration (samples, 3) of a point of a body, an arm from its origin."""
    turning: Array = np.cross(frame.spin, np.cross(frame.spin, arm))
    return frame.lift + np.cross(frame.spin_rate, arm) + turning


def _rotations(axis: Array, angle: Array) -> Array:
    """Returns the rotations (samples, 3, 3) about a unit axis by angles (samples,) [rad]."""
    cross = skew(axis)
    sine, versine = np.sin(angle)[:, None, None], 1.0 - np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def parameters(mass: float, com: tuple[float, ...], inertia: tuple[float, ...]) -> Array:
    """Returns phi (10,) of a body with an inertia about its centre of mass [kg, kg m, kg m2]."""
    c = np.array(com)
    about = inertia_matrix(inertia) + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([mass, *(mass * c), *(about[place] for place in ORDER)])


def body_parameters(robot: Robot) -> Array:
    """Returns phi (19, 10) of all bodies."""
    bodies: list[Torso | Link] = [robot.torso, *(link for leg in robot.legs for link in leg.links)]
    return np.array([parameters(body.mass, body.com, body.inertia) for body in bodies])


def wrench_matrices(frame: Frame) -> tuple[Array, Array]:
    """Returns force and moment of a body about its origin for each parameter (samples, 3, 10).

    Both are in torso axes; the parameters are in the body's.
    """
    spin, rate, lift = (
        np.einsum("nji,nj->ni", frame.turn, vector)
        for vector in (frame.spin, frame.spin_rate, frame.lift)
    )
    crossed = _skews(spin)
    force = np.zeros((len(spin), 3, PARAMETERS))
    force[:, :, 0] = lift
    force[:, :, 1:4] = _skews(rate) + crossed @ crossed
    moment = np.zeros((len(spin), 3, PARAMETERS))
    moment[:, :, 1:4] = -_skews(lift)
    moment[:, :, 4:] = _inertia_columns(rate) + crossed @ _inertia_columns(spin)
    return frame.turn @ force, frame.turn @ moment


def _inertia_columns(vector: Array) -> Array:
    """Returns the matrices A (samples, 3, 6) with I v = A (xx yy zz xy xz yz)."""
    found = np.zeros((len(vector), 3, len(ORDER)))
    for k, (i, j) in enumerate(ORDER):
        found[:, i, k] = vector[:, j]
        found[:, j, k] = vector[:, i]
    return found


def _skews(vector: Array) -> Array:
    """Returns the matrices (samples, 3, 3) with skew(a) b = a x b."""
    x, y, z = vector.T
    none = np.zeros_like(x)
    rows = [[none, -z, y], [z, none, -x], [-y, x, none]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def regressor(bodies: list[Frame]) -> Array:
    """Returns the 24 equations for the parameters of torso, coxae, femora and tibiae.

    Parameters of the links of one kind are added up over the legs: they are the same for all legs,
    or what all legs differ by from their own.

    Returns:
        (samples, 24, 40).
    """
    count = len(bodies[0].spin)
    found = np.zeros((count, EQUATIONS, GROUPS * PARAMETERS))
    for body in range(BODIES):
        group = 0 if body == 0 else 1 + (body - 1) % JOINTS
        columns = slice(PARAMETERS * group, PARAMETERS * (group + 1))
        found[:, :, columns] += body_equations(bodies, body)
    return found


def body_equations(bodies: list[Frame], body: int) -> Array:
    """Returns the 24 equations for the parameters of one body (samples, 24, 10)."""
    force, moment = wrench_matrices(bodies[body])
    return carried(bodies, body, bodies[body].origin, force, moment)


def carried(bodies: list[Frame], body: int, place: Array, force: Array, moment: Array) -> Array:
    """Returns what forces and moments on a body are in the 24 equations (samples, 24, columns).

    Args:
        bodies: frames of all bodies.
        body: on which they act.
        place: where the forces act, from the torso's origin (samples, 3) [m].
        force, moment: (samples, 3, columns), torso axes.
    """
    found = np.zeros((len(force), EQUATIONS, force.shape[2]))
    found[:, 0:3] = force
    found[:, 3:6] = moment + _skews(place) @ force
    leg, joint = divmod(body - 1, JOINTS)
    for k in range(joint + 1) if body > 0 else ():
        link = bodies[1 + JOINTS * leg + k]
        about = moment + _skews(place - link.origin) @ force
        found[:, 6 + JOINTS * leg + k] = np.einsum("ni,nic->nc", _axis(link), about)
    return found


def _axis(link: Frame) -> Array:
    if link.axis is None:
        raise ValueError("the torso has no joint")
    return link.axis


def foot_equations(robot: Robot, bodies: list[Frame], motion: Motion, normal: Array) -> Array:
    """Returns what the forces of the ground on the feet are in the 24 equations.

    normal: of the ground, world axes (3,). The forces are in world axes and act on the spheres'
    lowest points.

    Returns:
        (samples, 24, 18), three columns for each foot.
    """
    world = np.swapaxes(motion.turn, 1, 2)  # R_TW
    up = world @ normal
    found = []
    for leg in range(LEGS):
        tibia = JOINTS * (leg + 1)
        frame = bodies[tibia]
        point = frame.origin + frame.turn @ np.array(robot.legs[leg].links[2].tip)
        point = point - robot.foot.radius * up
        found.append(carried(bodies, tibia, point, world, np.zeros_like(world)))
    return np.concatenate(found, axis=2)


def body_wrenches(robot: Robot, bodies: list[Frame]) -> Array:
    """Returns the 24 equations (samples, 24) at the robot's own parameters.

    They equal what ground, motors and gears exert.
    """
    own = body_parameters(robot)
    return np.asarray(sum(body_equations(bodies, body) @ own[body] for body in range(BODIES)))
