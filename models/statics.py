"""How the robot stands: the pose in which nothing accelerates.

Tanh friction holds nothing at rest, so on level ground the feet spread until no tangential force is
left. On a slope no such pose exists; the robot stands while it creeps, and friction at the creep's
velocity carries what pulls it downhill. Under the bristle law it stands still there: what it has
given way downhill, as one body, carries it instead.

Where gravity pulls along the ground more than friction can hold, the robot slides. Then the pose is
the one in which all bodies accelerate alike: the pose of rest under gravity less that acceleration.
Without friction on level ground that acceleration is 0, and the pose is that of any other friction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from hexapod_cosim.models.actuator import servo_torque
from hexapod_cosim.models.contact import foot_contacts, foot_force
from hexapod_cosim.models.dynamics import masses
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.kinematics import (
    JOINTS,
    LEGS,
    axis_quaternion,
    body_states,
    cross,
    joint_models,
    quaternion_product,
    rotation_matrix,
)
from hexapod_cosim.models.records import STATIC_LAWS, Array, Baumgarte, Gait, Robot, Solver
from hexapod_cosim.models.terrain import ground_normal

RESIDUAL = 1e-9  # N and N m: some 1e4 times the rounding of forces of this size
ITERATIONS = 60
DIFFERENCE = 1e-7  # of the Jacobian's columns; Newton forgives its error
LEVEL = 1e-12  # of gravity: less of it along the ground is rounding
TORSO = 6  # of the unknowns, and of the residual
UNKNOWNS = TORSO + LEGS * JOINTS


@dataclass(frozen=True)
class Standing:
    """A pose of rest, or of sliding as one body; torso above the world's origin, heading along
    x.
    """

    position: Array  # (3,) m  torso's centre of mass
    quaternion: Array  # (4,)
    angle: Array  # (6, 3) rad
    velocity: Array  # (3,) m/s  creep along the ground, 0 on level ground and under the bristle law
    foot_force: Array  # (6, 3) N  ground on foot
    bristle: Array  # (6, 3) m  what the feet have given way, 0 but on a slope under the bristle law
    # (3,) m/s2  acceleration of the whole robot along the ground, 0 where friction holds it
    slide: Array


def sliding(gravity: Array, normal: Array, mu: float, mu_static: float = 0.0) -> Array:
    """(3,) acceleration [m/s2] with which a robot slides, 0 where friction holds it.

    Gravity that does not press the robot onto the ground lets it fall, not slide.

    Args:
        gravity: (3,) [m/s2].
        normal: (3,) of the ground, of unit length.
        mu: the friction coefficient, 0 for the law `none`.
        mu_static: that of feet that stick, mu if it is less.
    """
    press = -float(gravity @ normal)
    pull = gravity + press * normal
    size = float(np.linalg.norm(pull))
    if press <= 0.0 or size <= LEVEL * press or size < max(mu, mu_static) * press:
        return np.zeros(3)
    return np.asarray(pull * (1.0 - mu * press / size))


def _slide(robot: Robot) -> Array:
    """(3,) the same of a robot on its own ground."""
    mu = 0.0 if robot.friction.law == "none" else robot.friction.mu
    mu_static = robot.friction.mu_static if robot.friction.law in STATIC_LAWS else 0.0
    return sliding(np.array(robot.gravity), ground_normal(robot.terrain), mu, mu_static)


def _standing_part(robot: Robot) -> Robot:
    """The robot with one and the same of all that does not matter to how it stands: how motion is
    integrated, how it walks, and on level ground how strong its friction is, since it has nothing
    to hold.
    """
    friction, calm = (
        robot.friction,
        Solver(method="rosw3", step=0.0, tolerance=1e-4, step_max=1.0, projection="none"),
    )
    gravity, normal = np.array(robot.gravity), ground_normal(robot.terrain)
    press = -float(gravity @ normal)
    level = float(np.linalg.norm(gravity + press * normal)) <= LEVEL * press
    if level and (friction.law != "bristle" or max(friction.mu, friction.mu_static) == 0.0):
        friction = replace(friction, law="tanh", mu=1.0, mu_static=0.0)
    still = Gait(name="tripod", period=1.0, duty=0.5, stride=0.0, step_height=1.0)
    return replace(
        robot, solver=calm, gait=still, friction=friction, baumgarte=Baumgarte(alpha=0.0, beta=0.0)
    )


def _held(robot: Robot, slide: Array) -> Robot:
    """A sliding robot seen from a frame that slides with it.

    There gravity is less, and any friction above its own holds it.
    """
    mu = (
        1.0 if robot.friction.law == "none" or robot.friction.mu == 0.0 else 2.0 * robot.friction.mu
    )
    x, y, z = (np.array(robot.gravity) - slide).tolist()
    return replace(
        robot, gravity=(x, y, z), friction=replace(robot.friction, law="tanh", mu=mu, mu_static=0.0)
    )


def settled(robot: Robot) -> tuple[Array, Array, Array]:
    """Torso position (3,), quaternion (4,) and joint angles (6, 3) at rest on the ground, servos
    holding the stance. Raises RobotError.
    """
    pose = standing(robot)
    return pose.position, pose.quaternion, pose.angle


def standing(robot: Robot) -> Standing:
    """Equilibrium by Newton on torso height, roll, pitch, creep velocities (bristles: what it has
    given way) and joint angles.

    Servos in position or torque mode hold the stance by their PD law (a torque servo alone would
    not stand); kinematic ones exactly. Looked up when it was asked for before: the interface and
    every picture of a robot need it, and it is most of an export's time. Its arrays are read-only.
    Raises RobotError when there is no such pose: servos too weak or soft.
    """
    return _found(_standing_part(robot))


@lru_cache(maxsize=64)
def _found(given: Robot) -> Standing:
    slide = _slide(given)
    robot = _held(given, slide) if slide.any() else given
    x = _start(robot)
    loads = _loads(robot, x)
    for _ in range(ITERATIONS):
        if np.max(np.abs(_residual(robot, loads))) < RESIDUAL:
            pose = (
                _standing(robot, x)
                if not slide.any()
                else _sliding(given, _standing(robot, x), slide)
            )
            for array in vars(pose).values():
                array.flags.writeable = False
            return pose
        x, loads = _newton_step(robot, x, loads)
    raise _no_equilibrium(robot, _residual(robot, loads))


def _no_equilibrium(robot: Robot, residual: Array) -> RobotError:
    got = f"forces out of balance by {np.max(np.abs(residual)):.3g}"
    fix = "raise servo.kp or servo.torque_max, or change the stance"
    return RobotError(
        "the robot does not stand",
        got=got,
        expected=f"a pose in balance to {RESIDUAL} N",
        fix=fix,
        where=robot.name,
    )


def _newton_step(robot: Robot, x: Array, loads: Array) -> tuple[Array, Array]:
    """One damped step: halved until the residual falls, since feet lose the ground (and all
    slope) when a step is too long.
    """
    residual = _residual(robot, loads)
    try:
        step = np.linalg.solve(_jacobian(robot, x, loads), -residual)
    except np.linalg.LinAlgError as error:
        raise _no_equilibrium(robot, residual) from error
    for shorter in 0.5 ** np.arange(30):
        trial = _loads(robot, x + shorter * step)
        if np.linalg.norm(_residual(robot, trial)) < np.linalg.norm(residual):
            return x + shorter * step, trial
    raise _no_equilibrium(robot, residual)


def _jacobian(robot: Robot, x: Array, loads: Array) -> Array:
    """(24, 24) of the residual by differences. A leg's loads do not depend on other legs'
    angles: all legs' are moved at once.
    """

    def change(direction: Array) -> Array:
        return (_loads(robot, x + DIFFERENCE * direction) - loads) / DIFFERENCE

    jacobian = np.zeros((UNKNOWNS, UNKNOWNS))
    for column, unit in enumerate(np.eye(UNKNOWNS)[:TORSO]):
        changed = change(unit)
        jacobian[:, column] = np.concatenate(
            [changed[:, :TORSO].sum(axis=0), changed[:, TORSO:].ravel()]
        )
    for joint, unit in enumerate(np.eye(JOINTS)):
        changed = change(np.concatenate([np.zeros(TORSO), np.tile(unit, LEGS)]))
        for leg in range(LEGS):
            begin = TORSO + JOINTS * leg
            jacobian[:TORSO, begin + joint], jacobian[begin : begin + JOINTS, begin + joint] = (
                changed[leg, :TORSO],
                changed[leg, TORSO:],
            )
    return jacobian


def _start(robot: Robot) -> Array:
    """Unknowns z, roll, pitch, creep (vx, vy, yaw rate), angles: the stance, along the ground,
    its feet as deep as they carry.
    """
    x = np.zeros(UNKNOWNS)
    normal = ground_normal(robot.terrain)
    x[1], x[2] = -np.arcsin(normal[1]), np.arctan2(normal[0], normal[2])
    x[6:] = robot.stance.ravel()
    weight = robot.weight
    depth = (weight / LEGS / robot.contact.stiffness) ** (2.0 / 3.0)
    highest = min(foot.penetration for foot in foot_contacts(robot, _bodies(robot, x)))
    x[0] += (highest - depth) / normal[2]
    return x


def _attitude(x: Array) -> Array:
    roll, pitch = (
        axis_quaternion(np.array([1.0, 0.0, 0.0]), x[1]),
        axis_quaternion(np.array([0.0, 1.0, 0.0]), x[2]),
    )
    return quaternion_product(pitch, roll)


def _velocity(robot: Robot, x: Array) -> Array:
    """(3,) creep along the ground."""
    normal = ground_normal(robot.terrain)
    return np.array([x[3], x[4], -(normal[0] * x[3] + normal[1] * x[4]) / normal[2]])


def _bodies(robot: Robot, x: Array) -> Array:
    """(19, 13) bodies of the unknowns, all moving with the creep."""
    angle = x[6:].reshape(LEGS, JOINTS)
    turning = x[5] * ground_normal(robot.terrain)
    position = np.array([0.0, 0.0, x[0]])
    return body_states(
        robot, position, _attitude(x), _velocity(robot, x), turning, angle, np.zeros((LEGS, JOINTS))
    )


def _bristles(robot: Robot, body: Array) -> Array:
    """(6, 3) m. What the feet have given way: the creep of these bodies, read as so many
    preslidings for each m/s; 0 with other laws.
    """
    if robot.friction.law != "bristle":
        return np.zeros((LEGS, 3))
    return np.array(
        [
            robot.friction.presliding * (foot.velocity + foot.approach_speed * foot.normal)
            for foot in foot_contacts(robot, body)
        ]
    )


def _foot_forces(robot: Robot, body: Array) -> Array:
    """(6, 3) ground on feet [N]. Feet that bristles hold do not move."""
    feet, bristle = foot_contacts(robot, body), _bristles(robot, body)
    if robot.friction.law == "bristle":
        feet = tuple(replace(foot, velocity=np.zeros(3), approach_speed=0.0) for foot in feet)
    return np.array([foot_force(robot, foot, 0.0, bristle[leg]) for leg, foot in enumerate(feet)])


def _residual(robot: Robot, loads: Array) -> Array:
    """(24,) force and moment on the robot at the torso, and the torque left over at each joint
    (kinematic: rad off the stance).
    """
    weight = robot.torso.mass * np.array([*robot.gravity, 0.0, 0.0, 0.0])
    return np.concatenate([weight + loads[:, :TORSO].sum(axis=0), loads[:, TORSO:].ravel()])


def _loads(robot: Robot, x: Array) -> Array:
    """(6, 9) each leg's force and moment on the torso at its centre of mass, world axes, and
    what is left over at its joints.
    """
    body = _bodies(robot, x)
    force = masses(robot)[:, None] * np.array(robot.gravity)
    moment = np.zeros_like(force)
    for leg, (foot, push) in enumerate(
        zip(foot_contacts(robot, body), _foot_forces(robot, body), strict=True)
    ):
        tibia = JOINTS * (leg + 1)
        force[tibia] += push
        moment[tibia] += cross(foot.point - body[tibia, 0:3], push)
    on_torso, left_over = _carry_to_torso(robot, body, force, moment)
    angle = x[TORSO:]
    if robot.servo.mode == "kinematic":
        left_over = robot.stance.ravel() - angle
    else:
        servo, zero = replace(robot.servo, mode="position"), np.zeros_like(angle)
        left_over += servo_torque(servo, angle, zero, robot.stance.ravel(), zero, zero)
    return np.column_stack([on_torso, left_over.reshape(LEGS, JOINTS)])


def _carry_to_torso(robot: Robot, body: Array, force: Array, moment: Array) -> tuple[Array, Array]:
    """Adds each link's force and moment to that above it, leaf to root, in place; returns (6, 6)
    what the legs do to the torso, and (18,) torques about the joint axes.
    """
    on_torso, torque = np.zeros((LEGS, TORSO)), np.zeros(LEGS * JOINTS)
    for k, joint in reversed(list(enumerate(joint_models(robot)))):
        i, j = joint.parent, joint.child
        R_i = rotation_matrix(body[i, 3:7])
        sP_i = R_i @ joint.point_i
        at_joint = moment[j] + cross(body[j, 0:3] - (body[i, 0:3] + sP_i), force[j])
        torque[k] = at_joint @ (R_i @ joint.s_i)
        carried = at_joint + cross(sP_i, force[j])
        if i == 0:
            on_torso[k // JOINTS] = np.concatenate([force[j], carried])
        else:
            force[i] += force[j]
            moment[i] += carried
    return on_torso, torque


def _standing(robot: Robot, x: Array) -> Standing:
    position, angle = np.array([0.0, 0.0, x[0]]), x[6:].reshape(LEGS, JOINTS)
    body = _bodies(robot, x)
    creep = np.zeros(3) if robot.friction.law == "bristle" else _velocity(robot, x)
    return Standing(
        position,
        _attitude(x),
        angle,
        creep,
        _foot_forces(robot, body),
        _bristles(robot, body),
        np.zeros(3),
    )


def _sliding(robot: Robot, pose: Standing, slide: Array) -> Standing:
    """The pose of a robot that slides: without creep, its bristles stretched to the full
    downhill.
    """
    way = (
        robot.friction.presliding * slide / np.linalg.norm(slide)
        if robot.friction.law == "bristle"
        else np.zeros(3)
    )
    return replace(pose, velocity=np.zeros(3), bristle=np.tile(way, (LEGS, 1)), slide=slide)
