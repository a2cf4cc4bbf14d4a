"""Computes the pose in which the robot stands at rest.

Tanh friction has no force at rest, so on level ground the feet spread until no tangential force
remains. On a slope no pose of rest exists: the robot creeps, and friction at the creep velocity
balances gravity. With bristles the robot rests on a slope, and deflected bristles balance
gravity.

If gravity along the ground exceeds friction, the robot slides. The pose is then that of rest under
gravity minus the common acceleration of all bodies. Without friction on level ground this
acceleration is 0, and the pose is that of any other friction.

On a surface the robot takes its pose on level ground, at the height at which no foot is deeper in
the surface than it is on level ground. Where the feet stand on a level part of the surface, this is
the pose of rest; elsewhere the robot falls by the unevenness under its feet when a run begins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.equilibrium import (
    attitude,
    creep_velocity,
    deflections,
    foot_forces,
    imbalance,
    imbalance_slopes,
    leg_loads,
    moving_bodies,
    start_unknowns,
)
from hexapod_cosim.models.errors import RobotError
from hexapod_cosim.models.ground.faces import ground, ground_height, ground_normal, surface_of
from hexapod_cosim.models.kinematics import JOINTS, LEGS, body_states, foot_centres
from hexapod_cosim.models.method import Baumgarte, Solver
from hexapod_cosim.models.records import Gait, Robot

RESIDUAL = 1e-9  # N, N m  about 1e4 times the rounding of such forces
ITERATIONS = 60
LEVEL = 1e-12  # 1  of gravity; a smaller part along the ground is rounding
LEAST_RISE = 1e-13  # m
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Standing:
    """A pose of rest, or of sliding as one body.

    The torso is above the world's origin and heads along x.
    """

    position: Array  # (3,) m  torso's centre of mass
    quaternion: Array  # (4,)
    angle: Array  # (6, 3) rad
    velocity: Array  # (3,) m/s  creep along the ground, 0 on level ground and under the bristle law
    foot_force: Array  # (6, 3) N  ground on foot
    bristle: Array  # (6, 3) m  deflections; 0 on level ground or without the bristle law
    # (3,) m/s2  acceleration of the whole robot along the ground, 0 where friction holds it
    slide: Array


def sliding(gravity: Array, normal: Array, mu: float, mu_static: float = 0.0) -> Array:
    """Returns the acceleration (3,) [m/s2] of a sliding robot, 0 where friction holds it.

    It is also 0 if gravity does not press the robot onto the ground.

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


def _slide_acceleration(robot: Robot) -> Array:
    """Returns the acceleration (3,) [m/s2] with which the robot slides on its ground."""
    mu = robot.friction.mu if robot.friction.has_friction else 0.0
    # under the tanh law static friction holds no foot
    mu_static = robot.friction.mu_static if robot.friction.has_bristles else 0.0
    return sliding(np.array(robot.gravity), ground_normal(robot.terrain), mu, mu_static)


def _standing_key(robot: Robot) -> Robot:
    """Returns the robot with fixed values of all data that do not affect how it stands.

    These are the integrator, the gait and, on level ground, friction. The result is the key of the
    cache.
    """
    friction = robot.friction
    calm = Solver(method="rosw3", step=0.0, tolerance=1e-4, step_max=1.0, projection="none")
    gravity, normal = np.array(robot.gravity), ground_normal(robot.terrain)
    press = -float(gravity @ normal)
    level = float(np.linalg.norm(gravity + press * normal)) <= LEVEL * press
    if level and (not friction.has_bristles or max(friction.mu, friction.mu_static) == 0.0):
        friction = replace(friction, law="tanh", mu=1.0, mu_static=0.0, viscous=0.0)
    still = Gait(name="tripod", period=1.0, duty=0.5, stride=0.0, step_height=1.0)
    return replace(
        robot, solver=calm, gait=still, friction=friction, baumgarte=Baumgarte(alpha=0.0, beta=0.0)
    )


def _in_sliding_frame(robot: Robot, slide: Array) -> Robot:
    """Returns a sliding robot in a frame that slides with it.

    Gravity is reduced by the frame's acceleration, and friction is raised so that it holds the
    robot.
    """
    friction = robot.friction
    mu = 2.0 * friction.mu if friction.has_friction and friction.mu != 0.0 else 1.0
    x, y, z = (np.array(robot.gravity) - slide).tolist()
    return replace(
        robot, gravity=(x, y, z), friction=replace(friction, law="tanh", mu=mu, mu_static=0.0)
    )


def settled(robot: Robot) -> tuple[Array, Array, Array]:
    """Returns torso position (3,) [m], quaternion (4,) and joint angles (6, 3) [rad] at rest on the
    ground.

    Servos hold the stance. Raises RobotError.
    """
    pose = standing(robot)
    return pose.position, pose.quaternion, pose.angle


def standing(robot: Robot) -> Standing:
    """Returns the equilibrium pose; results are cached, and their arrays are read-only.

    Newton's method solves for torso height, roll, pitch, creep velocities (bristle law:
    deflections) and joint angles. Servos in position or torque mode hold the stance by their PD
    law, because torque servos alone would not stand; kinematic drives hold it exactly. Raises
    RobotError when there is no such pose because servos are too weak or too soft.
    """
    if surface_of(robot.terrain) is None:
        return _cached_standing(_standing_key(robot))
    level = replace(robot, terrain=replace(robot.terrain, kind="flat", surface=None))
    pose = _cached_standing(_standing_key(level))
    position = pose.position + np.array([0.0, 0.0, _rise(robot, pose)])
    position.flags.writeable = False
    return replace(pose, position=position)


def _rise(robot: Robot, pose: Standing) -> float:
    """Returns how far [m] the pose on level ground has to rise on the robot's surface.

    The feet are then at most as deep in the surface as in level ground.
    """
    still = np.zeros((LEGS, JOINTS))
    body = body_states(
        robot, pose.position, pose.quaternion, np.zeros(3), np.zeros(3), pose.angle, still
    )
    terrain, centres = robot.terrain, foot_centres(robot, body)
    allowed = centres[:, 2] - terrain.height  # distance of the centres from level ground
    rise = max(ground_height(terrain, x, y) for x, y, _ in centres) - terrain.height
    for _ in range(ITERATIONS):
        nearest = [ground(terrain, centre + rise * UP)[0] for centre in centres]
        deeper = float(np.max(allowed - nearest))
        if deeper <= LEAST_RISE:
            break
        rise += deeper
    return rise


@lru_cache(maxsize=64)
def _cached_standing(given: Robot) -> Standing:
    """Solves for the equilibrium of a robot of `_standing_key`."""
    slide = _slide_acceleration(given)
    robot = _in_sliding_frame(given, slide) if slide.any() else given
    x = start_unknowns(robot)
    loads = leg_loads(robot, x)
    for _ in range(ITERATIONS):
        if np.max(np.abs(imbalance(robot, loads))) < RESIDUAL:
            pose = _standing(robot, x)
            if slide.any():
                pose = _sliding(given, pose, slide)
            for array in vars(pose).values():
                array.flags.writeable = False
            return pose
        x, loads = _newton_step(robot, x, loads)
    raise _no_equilibrium(robot, imbalance(robot, loads))


def _no_equilibrium(robot: Robot, residual: Array) -> RobotError:
    """Returns the exception for a residual that does not vanish."""
    got = f"forces out of balance by {np.max(np.abs(residual)):.3g}"
    fix = "raise servo.kp or servo.torque_max, or change the stance"
    what = "the robot does not stand"
    expected = f"a pose in balance to {RESIDUAL} N"
    return RobotError(what, got=got, expected=expected, fix=fix, where=robot.name)


def _newton_step(robot: Robot, x: Array, loads: Array) -> tuple[Array, Array]:
    """Computes a damped Newton step, which is halved until the residual decreases.

    Feet that lose the ground after too long a step have no derivatives.
    """
    residual = imbalance(robot, loads)
    try:
        step = np.linalg.solve(imbalance_slopes(robot, x, loads), -residual)
    except np.linalg.LinAlgError as error:
        raise _no_equilibrium(robot, residual) from error
    for shorter in 0.5 ** np.arange(30):
        trial = leg_loads(robot, x + shorter * step)
        if np.linalg.norm(imbalance(robot, trial)) < np.linalg.norm(residual):
            return x + shorter * step, trial
    raise _no_equilibrium(robot, residual)


def _standing(robot: Robot, x: Array) -> Standing:
    """Returns the pose of rest of the unknowns."""
    position, angle = np.array([0.0, 0.0, x[0]]), x[6:].reshape(LEGS, JOINTS)
    body = moving_bodies(robot, x)
    creep = np.zeros(3) if robot.friction.has_bristles else creep_velocity(robot, x)
    force, bristle = foot_forces(robot, body), deflections(robot, body)
    return Standing(position, attitude(x), angle, creep, force, bristle, np.zeros(3))


def _sliding(robot: Robot, pose: Standing, slide: Array) -> Standing:
    """Returns the pose of a sliding robot: without creep, with fully deflected bristles."""
    way = np.zeros(3)
    if robot.friction.has_bristles:
        way = robot.friction.presliding * slide / np.linalg.norm(slide)
    return replace(pose, velocity=np.zeros(3), bristle=np.tile(way, (LEGS, 1)), slide=slide)
