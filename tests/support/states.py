"""Provides random but seeded robots, motions and commands for the plant's tests, as general as the
equations allow.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
from plant import Plant
from scaled_robots import scaled_part

from hexapod_cosim.models import BodyContact, Leg, Link, Robot, load_robot
from hexapod_cosim.models.arrays import Array, Vector6
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.ground.faces import ground_normal
from hexapod_cosim.models.kinematics import body_states

LEGS, JOINTS = 6, 3
MACRO = 0.004  # s, macro-step of a trail
DRIFT = 0.02  # m, m/s, ... of drifted bodies


def changed(robot: Robot, **sections: dict[str, Any]) -> Robot:
    """Replaces fields of sections of a robot: changed(robot, servo={"mode": "torque"})."""
    return replace(
        robot,
        **{name: replace(getattr(robot, name), **fields) for name, fields in sections.items()},
    )


def with_links(robot: Robot, joint: int, **fields: Any) -> Robot:
    """Replaces fields of one link of every leg."""
    legs = []
    for leg in robot.legs:
        links = list(leg.links)
        links[joint] = replace(links[joint], **fields)
        legs.append(replace(leg, links=(links[0], links[1], links[2])))
    return replace(robot, legs=tuple(legs))


def scaled(robot: Robot, size: float) -> Robot:
    """Multiplies every length of a robot, and inertias by its square; masses stay the same."""
    part = {"com": 1, "inertia": 2}
    legs = []
    for leg in robot.legs:
        lengths = {"length": 1, "offset_y": 1, "offset_z": 1}
        coxa, femur, tibia = (scaled_part(link, size, part | lengths) for link in leg.links)
        moved = scaled_part(leg, size, {"hip_position": 1})
        legs.append(replace(moved, links=(coxa, femur, tibia)))
    servo = scaled_part(robot.servo, size, {"rotor_inertia": 2})
    return replace(robot, torso=scaled_part(robot.torso, size, part), legs=tuple(legs), servo=servo)


def lopsided(seed: int = 0) -> Robot:
    """Returns a robot without symmetries.

    It has inclined axes, offsets, products of inertia, and a centre of mass away from the torso's
    origin. Its feet alone touch the ground.
    """
    robot, rng = load_robot("phantomx_mk4"), np.random.default_rng(seed)
    torso = replace(
        robot.torso,
        com=tuple(rng.normal(0.0, 0.02, 3)),
        inertia=random_inertia(rng, robot.torso.mass, 0.08),
    )
    legs = tuple(_lopsided_leg(leg, rng) for leg in robot.legs)
    return replace(robot, torso=torso, legs=legs, body=BodyContact())


def _lopsided_leg(leg: Leg, rng: np.random.Generator) -> Leg:
    coxa, femur, tibia = (_lopsided_link(link, rng) for link in leg.links)
    hip = tuple(np.add(leg.hip_position, rng.normal(0.0, 0.02, 3)))
    return replace(
        leg,
        links=(coxa, femur, tibia),
        hip_position=hip,
        hip_yaw=leg.hip_yaw + rng.normal(0.0, 0.2),
    )


def _lopsided_link(link: Link, rng: np.random.Generator) -> Link:
    mass, axis = link.mass * rng.uniform(0.5, 2.0), np.add(link.axis, rng.normal(0.0, 0.2, 3))
    return replace(
        link,
        mass=mass,
        length=link.length * rng.uniform(0.8, 1.2),
        offset_y=rng.normal(0.0, 0.01),
        offset_z=rng.normal(0.0, 0.01),
        com=tuple(np.add(link.com, rng.normal(0.0, 0.005, 3))),
        inertia=random_inertia(rng, mass, 0.03),
        axis=tuple(axis / np.linalg.norm(axis)),
    )


def random_inertia(rng: np.random.Generator, mass: float, size: float) -> Vector6:
    """Returns xx yy zz xy xz yz of a random cloud of mass points of this size [m]."""
    points = rng.normal(0.0, size, (8, 3))
    second = mass / 8.0 * points.T @ points
    J = np.trace(second) * np.eye(3) - second
    return (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])


def random_pose(robot: Robot, seed: int) -> dict[str, Array]:
    """Returns a moving initial state near the stance with three feet in the ground, the third by
    0.5 mm, the others by half their radius at most.
    """
    pose = _scattered_pose(robot, seed)
    for leg in range(LEGS):
        _raise_foot(robot, pose, leg)
    return pose


def _scattered_pose(robot: Robot, seed: int) -> dict[str, Array]:
    """Returns a state as `random_pose`, in which two feet are in the ground at any depth."""
    rng = np.random.default_rng(seed)
    pose = {
        "position": np.array([0.3, -0.2, 0.0]),
        "quaternion": np.array([1.0, 0.0, 0.0, 0.0]) + rng.normal(0.0, 0.05, 4),
        "velocity": rng.normal(0.0, 0.3, 3),
        "angular_velocity": rng.normal(0.0, 1.0, 3),
        "angle": robot.stance + rng.normal(0.0, 0.2, (LEGS, JOINTS)),
        "speed": rng.normal(0.0, 1.0, (LEGS, JOINTS)),
    }
    pose["position"][2] = lift(robot, body_states(robot, **pose))
    return pose


def _raise_foot(robot: Robot, pose: dict[str, Array], leg: int) -> None:
    """Bends the femur of a leg whose foot is deeper than half its radius until it is as deep."""
    given = float(pose["angle"][leg, 1])

    def excess(bend: float) -> float:
        pose["angle"][leg, 1] = given + bend
        feet = foot_contacts(robot, body_states(robot, **pose))
        return feet[leg].penetration - 0.5 * robot.foot.radius

    low, high = 0.0, 1.0
    if excess(low) <= 0.0:
        return
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    excess(high)


def lift(robot: Robot, body: Array) -> float:
    """Returns how far [m] bodies must be raised for the third deepest foot to be 0.5 mm in the
    ground.
    """
    depth = sorted(foot.penetration for foot in foot_contacts(robot, body))
    return (depth[-3] - 5e-4) / float(ground_normal(robot.terrain)[2])


def random_bodies(robot: Robot, seed: int, *, drift: float = 0.0) -> Array:
    """Returns bodies (19, 13) of a random pose, moved off their joints by about `drift` (m, m/s,
    ...).
    """
    body = body_states(robot, **random_pose(robot, seed))
    body = body + drift * np.random.default_rng(seed + 500).normal(0.0, 1.0, body.shape)
    body[:, 3:7] /= np.linalg.norm(body[:, 3:7], axis=1, keepdims=True)
    body[:, 2] += lift(robot, body)
    return body


def drifted(core: ct.CDLL, robot: Robot, seed: int) -> tuple[Plant, Array]:
    """Returns a plant at random bodies that are off their joints by about DRIFT, and the bodies."""
    plant, body = Plant(core, robot), random_bodies(robot, seed, drift=DRIFT)
    plant.bodies = body
    return plant, body


def random_command(robot: Robot, seed: int, *, size: float = 1.0) -> Command:
    """Returns a command near the stance with pushes in all directions, some of whose torques exceed
    the servos' limit.
    """
    rng = np.random.default_rng(seed + 1000)
    return Command(
        angle_ref=robot.stance + size * rng.normal(0.0, 0.1, (LEGS, JOINTS)),
        speed_ref=size * rng.normal(0.0, 0.5, (LEGS, JOINTS)),
        torque_ref=size * rng.normal(0.0, 1.0, (LEGS, JOINTS)),
        push_force=size * rng.normal(0.0, 20.0, 3),
        push_torque=size * rng.normal(0.0, 2.0, 3),
        acceleration_ref=size * rng.normal(0.0, 20.0, (LEGS, JOINTS)),
    )


def landing(robot: Robot, seed: int = 3) -> dict[str, Array]:
    """Returns a start with the lowest foot 2 mm above the ground, falling; feet touch down one
    after the other within about 50 ms.
    """
    pose = _scattered_pose(robot, seed) | {"velocity": np.array([0.1, 0.0, -0.5])}
    clearance = -max(foot.penetration for foot in foot_contacts(robot, body_states(robot, **pose)))
    pose["position"][2] += 2e-3 - clearance
    return pose


def trail(plant: Plant, count: int, *, first: int = 0) -> list[bytes]:
    """Returns the plant's state after each of some macro-steps with different commands."""
    saved = []
    for k in range(first, first + count):
        plant.step((k + 1) * MACRO, random_command(plant.robot, k, size=0.2))
        saved.append(plant.save())
    return saved


def distance(a: Any, b: Any) -> float:
    """Returns the largest difference of two arrays, divided by the largest element of the second if
    that exceeds 1.
    """
    return float(np.max(np.abs(np.subtract(a, b)))) / max(1.0, float(np.max(np.abs(b))))
