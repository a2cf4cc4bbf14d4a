"""Tests contacts of torso, knees and shanks, and distances between neighbouring legs: C plant,
twin, laws and closed forms.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mirror import LEGS
from plant import Plant, inputs, pointer
from states import changed, distance, lopsided, random_bodies, random_command, random_pose

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.bodies import (
    body_contacts,
    body_spheres,
    clearances,
    leg_points,
    nearest_shares,
    open_body_contact,
    standing_body_damping,
)
from hexapod_cosim.models.contact.forces import contacts_of
from hexapod_cosim.models.contact.geometry import foot_force, standing_damping
from hexapod_cosim.models.dynamics import Command, accelerations
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.stage import keep_slopes, solve_stage

DENSE = 1e-10  # relative: the error of the dense solution, whose condition number is about 1e6
Z = 7e-4  # s: h gamma of a step in which the stiff terms dominate
TOUCHING: dict[str, Any] = {"contact": "on"}
# the high floor keeps the damping low, so that receding bodies still press
SOFT = {"impact_speed_floor": 2.0}


def sprawled(robot: Robot, seed: int, *, drift: float = 0.0) -> Array:
    """Returns moving bodies (19, 13), lowered until torso, knees and shanks are in the ground."""
    body = random_bodies(robot, seed, drift=drift)
    spheres = body_spheres(robot)
    deep = [
        max(
            contact.penetration
            for sphere, contact in zip(spheres, body_contacts(robot, body), strict=True)
            if sphere.name.endswith(part)
        )
        for part in ("torso", "knee", "shank")
    ]
    body[:, 2] += min(deep) - 2e-3
    return body


def wide(robot: Robot) -> Robot:
    """Returns the robot with bodies so large that torso, knees and shanks can touch at once."""
    size = {"torso_box": (0.12, 0.1, 0.12), "knee_radius": 0.1, "shank_radius": 0.06}
    return changed(robot, body=TOUCHING | size, contact=SOFT)


def at(core: ct.CDLL, robot: Robot, body: Array) -> Plant:
    plant = Plant(core, robot)
    plant.bodies = body
    return plant


def touching_parts(robot: Robot, body: Array) -> set[str]:
    pairs = zip(body_spheres(robot), body_contacts(robot, body), strict=True)
    return {sphere.name.split(".")[-1] for sphere, contact in pairs if contact.penetration > 0.0}


@pytest.mark.parametrize("friction", ["tanh", "none", "bristle"])
@pytest.mark.parametrize("terrain", ["flat", "slope"])
def test_accelerations_with_the_body_in_the_ground_are_those_of_the_dense_system(
    core: ct.CDLL, friction: str, terrain: str
) -> None:
    slope = {"kind": terrain, "incline": 0.2, "heading": 2.1}
    robot = changed(wide(lopsided(3)), friction={"law": friction}, terrain=slope)
    for seed, drift in ((0, 0.0), (1, 1e-3)):
        body, command = sprawled(robot, seed, drift=drift), random_command(robot, seed)
        dense = accelerations(robot, body, command, standing_damping(robot, body))
        ours = at(core, robot, body).accelerations(command)
        assert touching_parts(robot, body) == {"torso", "knee", "shank"}
        assert distance(ours.dv, dense.dv) < DENSE
        assert distance(ours.multipliers, dense.multipliers) < DENSE


def body_forces(robot: Robot, body: Array) -> Array:
    """Returns the forces (n, 3) of the ground on all spheres at impact speed 0 [N]."""
    smooth = replace(robot, friction=open_body_contact(robot).friction)
    damping = standing_body_damping(robot, body)
    contacts = zip(body_contacts(robot, body), damping, strict=True)
    return np.array([foot_force(smooth, contact, float(d)) for contact, d in contacts])


def test_the_outputs_are_the_forces_of_the_twin(core: ct.CDLL) -> None:
    robot = wide(lopsided(4))
    body = sprawled(robot, 4)
    output = at(core, robot, body).output(random_command(robot, 4))
    forces = body_forces(robot, body)
    assert len(forces) == 8 + 2 * LEGS
    assert distance(output.torso.contact_force, forces[:8].sum(axis=0)) < DENSE
    assert distance(output.body.knee_force, forces[8:14]) < DENSE
    assert distance(output.body.shank_force, forces[14:]) < DENSE
    assert min(np.abs(f).max() for f in (forces[:8], forces[8:14], forces[14:])) > 1.0


def stage_rates(
    core: ct.CDLL, plant: Plant, command: Command, s_x: Array, s_v: Array
) -> tuple[Array, Array]:
    """Returns nu and alpha (19, 6) of a stage after the changes s_x and s_v (19, 6)."""
    rate, turn = np.zeros((19, 13)), np.zeros((19, 3))
    arguments: list[Any] = [ct.c_void_p(plant.handle), ct.byref(inputs(command))]
    arguments += [ct.c_double(Z), ct.c_double(0.0)]
    core.hx_probe_stage(*arguments, *map(pointer, (s_x, s_v, rate, turn)))
    return np.hstack([rate[:, 0:3], turn]), rate[:, 7:13]


def test_an_implicit_stage_with_the_body_in_the_ground_is_the_dense_one(core: ct.CDLL) -> None:
    robot = wide(lopsided(5))
    body, command = sprawled(robot, 5), random_command(robot, 5)
    damping, held = standing_damping(robot, body), standing_body_damping(robot, body)
    bristle, rng = np.zeros((6, 3)), np.random.default_rng(5)
    touching = contacts_of(robot, damping, held)
    slopes = keep_slopes(robot, body, bristle, command, touching, 0.0)
    plant = at(core, robot, body)
    for _ in range(3):
        s_x, s_v = rng.normal(0.0, 1e-3, (19, 6)), rng.normal(0.0, 0.1, (19, 6))
        change = (s_x.ravel(), s_v.ravel(), bristle)
        dense = solve_stage(robot, body, bristle, command, touching, slopes, Z, change)
        nu, alpha = stage_rates(core, plant, command, s_x, s_v)
        assert distance(alpha, dense.alpha.reshape(19, 6)) < DENSE
        assert distance(nu, dense.nu.reshape(19, 6)) < DENSE


# Tests the distances between neighbouring legs: C plant, twin, closed forms and brute force.

RING = (0, 1, 2, 5, 4, 3)  # LF LM LR RR RM RF
SAMPLES = 61  # of each line, by brute force


def line_distance(p: Array, a: Array, q: Array, b: Array) -> float:
    """Returns the distance [m] between the lines p + s a and q + t b with s, t in [0, 1]."""
    s, t = nearest_shares(p, a, q, b)
    return float(np.linalg.norm(p - q + s * a - t * b))


def brute_force(p: Array, a: Array, q: Array, b: Array) -> float:
    """Returns the least distance of samples of two lines, refined around the nearest pair."""
    (s, t), width = (0.5, 0.5), 0.5
    for _ in range(9):
        x = np.clip(np.linspace(s - width, s + width, SAMPLES), 0.0, 1.0)
        y = np.clip(np.linspace(t - width, t + width, SAMPLES), 0.0, 1.0)
        d = p + x[:, None, None] * a - q - y[None, :, None] * b
        far = np.linalg.norm(d, axis=2)
        i, j = np.unravel_index(int(np.argmin(far)), far.shape)
        s, t, width = float(x[i]), float(y[j]), width / 8.0
    return float(far.min())


def test_the_distance_of_lines_is_that_of_their_samples() -> None:
    rng = np.random.default_rng(1)
    for _ in range(60):
        p, a, q, b = rng.normal(size=(4, 3))
        assert line_distance(p, a, q, b) == pytest.approx(brute_force(p, a, q, b), abs=1e-7)


def test_the_distance_of_lines_has_its_closed_forms() -> None:
    x, y, z = np.eye(3)
    o = np.zeros(3)
    assert line_distance(-x, 2.0 * x, 0.3 * z - y, 2.0 * y) == pytest.approx(0.3, abs=1e-15)
    assert line_distance(o, x, 0.5 * x + 0.2 * y, x) == pytest.approx(0.2, abs=1e-15)
    assert line_distance(o, x, 4.0 * x + 4.0 * y, x) == pytest.approx(5.0, abs=1e-15)
    assert line_distance(o, o, 3.0 * x + 4.0 * y, o) == pytest.approx(5.0, abs=1e-15)
    assert line_distance(o, 2.0 * x, x - y, 2.0 * y) == 0.0


def test_the_plants_clearance_is_that_of_the_twin_and_of_brute_force(core: ct.CDLL) -> None:
    size = {"knee_radius": 0.02, "shank_radius": 0.01}
    for seed, own in enumerate((load_robot("athena"), lopsided(1), lopsided(2))):
        robot = changed(own, body=size)
        body = body_states(robot, **random_pose(robot, seed))
        plant = Plant(core, robot)
        plant.bodies = body
        ours = plant.output().body.clearance
        assert ours == pytest.approx(clearances(robot, body), abs=1e-14)
        points, radius = leg_points(robot, body), (0.02, 0.01)
        least = np.full(6, np.inf)
        for leg, other in zip(RING, (*RING[1:], RING[0]), strict=True):
            for i in range(2):
                for j in range(2):
                    a = points[leg, i + 1] - points[leg, i]
                    b = points[other, j + 1] - points[other, j]
                    gap = brute_force(points[leg, i], a, points[other, j], b)
                    gap -= radius[i] + radius[j]
                    least[[leg, other]] = np.minimum(least[[leg, other]], gap)
        assert ours == pytest.approx(least, abs=1e-7)
