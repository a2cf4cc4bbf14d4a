"""Tests the O(n) solution of eq. 1 by the C plant against the dense 204 x 204 system,
and its linearly implicit form against the dense one.
"""

from __future__ import annotations

import ctypes as ct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mirror import LEGS
from plant import Plant, inputs, pointer
from slopes import resting, slopes
from states import changed, distance, lopsided, random_bodies, random_command

from hexapod_cosim.models import CONTACT_LAWS, Robot, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import constraints
from hexapod_cosim.models.contact.geometry import foot_contacts, foot_force, standing_damping
from hexapod_cosim.models.contact.law import contact_damping
from hexapod_cosim.models.dynamics import Command, accelerations, mass_matrix
from hexapod_cosim.models.kinematics import quaternion_rate, skew

DENSE = 1e-10  # relative: the error of the dense solution, whose condition number is about 1e6
MODES = ("position", "torque", "kinematic")
# the high floor keeps the damping low, so that receding feet still press; feet alone touch
ROBOTS = {
    robot.name: changed(robot, contact={"impact_speed_floor": 2.0}, body={"contact": "off"})
    for robot in (
        load_robot("athena"),
        load_robot("phantomx_mk4"),
        replace(lopsided(), name="lopsided"),
    )
}


def at(core: ct.CDLL, robot: Robot, body: Array) -> Plant:
    plant = Plant(core, robot)
    plant.bodies = body
    return plant


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("terrain", ["flat", "slope"])
def test_accelerations_and_multipliers_are_those_of_the_dense_system(
    core: ct.CDLL, robot: Robot, mode: str, terrain: str
) -> None:
    robot = changed(
        robot, servo={"mode": mode}, terrain={"kind": terrain, "incline": 0.3, "heading": 2.1}
    )
    for seed, drift in ((0, 0.0), (1, 0.0), (2, 1e-3), (3, 0.05)):
        body, command = random_bodies(robot, seed, drift=drift), random_command(robot, seed)
        ours = at(core, robot, body).accelerations(command)
        dense = accelerations(robot, body, command, standing_damping(robot, body))
        assert np.count_nonzero(at(core, robot, body).output(command).foot.normal_force) >= 3
        assert distance(ours.dv, dense.dv) < DENSE
        assert distance(ours.multipliers, dense.multipliers) < DENSE
        assert distance(ours.drive_torque, dense.drive_torque) < DENSE


@pytest.mark.parametrize("law", CONTACT_LAWS)
@pytest.mark.parametrize("friction", ["tanh", "none", "bristle"])
def test_accelerations_are_those_of_the_dense_system_under_every_law(
    core: ct.CDLL, law: str, friction: str
) -> None:
    robot = changed(
        lopsided(4), contact={"law": law, "impact_speed_floor": 2.0}, friction={"law": friction}
    )
    body, command = random_bodies(robot, 4, drift=1e-3), random_command(robot, 4)
    dense = accelerations(robot, body, command, standing_damping(robot, body))
    ours = at(core, robot, body).accelerations(command)
    assert distance(ours.dv, dense.dv) < DENSE
    assert distance(ours.multipliers, dense.multipliers) < DENSE


# the linearly implicit solve: W u + D^T mu = G_v dv + G_x dx, D u = 0, W = M - z G_v - z^2 G_x

DIFFERENCES = 1e-5  # relative: error of differences of a force of 10 N whose slope is 1e5 N/m
Z = 7e-4  # s: h gamma of a step in which the stiff terms dominate


def implicit(core: ct.CDLL, plant: Plant, command: Command, dx: Array, dv: Array) -> Array:
    """Returns u (114,), the change of the accelerations a by a stage, for given displacements dx
    and velocity changes dv (19, 6), linear then angular.

    The stage's increments satisfy s_v + z a = dv and s_x + z (v + s_v) + z^2 a = dx.
    """
    body, a = plant.bodies, plant.accelerations(command).dv
    s_v = dv - Z * a
    s_x = dx - Z * (body[:, 7:13] + s_v) - Z * Z * a
    rate, turn = stage(core, plant, command, s_x, s_v)
    u = rate[:, 7:13] - a
    reached = body[:, 7:13] + s_v + Z * rate[:, 7:13]
    assert distance(rate[:, 0:3], reached[:, 0:3]) < DENSE
    assert distance(turn, reached[:, 3:6]) < DENSE
    assert (
        distance(
            rate[:, 3:7],
            [quaternion_rate(state[3:7], w) for state, w in zip(body, turn, strict=True)],
        )
        < DENSE
    )
    return u.ravel()


def stage(
    core: ct.CDLL, plant: Plant, command: Command, s_x: Array, s_v: Array
) -> tuple[Array, Array]:
    """Returns k/h (19, 13) of a stage after the changes (19, 6), and the angular velocities (19, 3)
    of its quaternion rates.
    """
    rate, turn = np.zeros((19, 13)), np.zeros((19, 3))
    arguments: list[Any] = [
        ct.c_void_p(plant.handle),
        ct.byref(inputs(command)),
        ct.c_double(Z),
        ct.c_double(0.0),
    ]
    core.hx_probe_stage(
        *arguments,
        pointer(np.ascontiguousarray(s_x)),
        pointer(np.ascontiguousarray(s_v)),
        pointer(rate),
        pointer(turn),
    )
    return rate, turn


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("terrain", ["flat", "slope"])
def test_the_implicit_solve_is_the_dense_one_with_slopes_from_differences(
    core: ct.CDLL, mode: str, terrain: str
) -> None:
    robot = changed(
        lopsided(8), servo={"mode": mode}, terrain={"kind": terrain, "incline": 0.2, "heading": 0.5}
    )
    body, rng = resting(robot, 8), np.random.default_rng(8)
    # one servo in ten is at its torque limit, where it has no stiffness
    command = Command(angle_ref=robot.stance + 10.0 * (rng.uniform(size=(6, 3)) < 0.1))
    G_x, G_v = slopes(robot, command, body)
    joints = constraints(robot, body)
    D = np.vstack([joints.D, joints.G]) if mode == "kinematic" else joints.D
    W = mass_matrix(robot, body) - Z * G_v - Z * Z * G_x
    system = np.block([[W, D.T], [D, np.zeros((len(D), len(D)))]])
    plant = at(core, robot, body)
    for _ in range(4):
        dx, dv = rng.normal(0.0, 1e-3, (19, 6)), rng.normal(size=(19, 6))
        right = np.concatenate([G_v @ dv.ravel() + G_x @ dx.ravel(), np.zeros(len(D))])
        dense = np.linalg.solve(system, right)[:114]
        ours = implicit(core, plant, command, dx, dv)
        assert float(np.max(np.abs(ours - dense))) < DIFFERENCES * float(np.max(np.abs(dense)))
    assert np.count_nonzero(plant.output().foot.contact) in range(2, LEGS)


def test_the_stage_matrix_uses_the_secant_of_friction_when_a_foot_slips(core: ct.CDLL) -> None:
    robot = changed(load_robot("athena"), servo={"mode": "torque", "coulomb_friction": 0.0})
    body = resting(robot, 9)
    body[:, 7:9] += np.array([0.02, 0.01])
    plant, rng = at(core, robot, body), np.random.default_rng(9)
    G_v = np.zeros((114, 114))
    G_x = np.zeros((114, 114))
    damping = contact_damping(robot.contact, 0.0)
    for leg, foot in enumerate(foot_contacts(robot, body)):
        if foot.penetration > 0.0:
            normal, speed = float(foot_force(robot, foot, damping)[2]), float(np.hypot(0.02, 0.01))
            drag = robot.friction.mu * normal * np.tanh(robot.friction.slope * speed) / speed
            root = robot.contact.stiffness * np.sqrt(foot.penetration)
            rows = slice(18 * (leg + 1), 18 * (leg + 1) + 6)
            wrench = np.vstack([np.eye(3), skew(foot.point - body[3 * (leg + 1), 0:3])])
            G_v[rows, rows] -= (
                wrench @ np.diag([drag, drag, root * foot.penetration * damping]) @ wrench.T
            )
            G_x[rows, rows] -= wrench @ np.diag([0.0, 0.0, 1.5 * root]) @ wrench.T
    D = constraints(robot, body).D
    W = mass_matrix(robot, body) - Z * G_v - Z * Z * G_x
    dx, dv = rng.normal(0.0, 1e-3, (19, 6)), rng.normal(size=(19, 6))
    right = np.concatenate([G_v @ dv.ravel() + G_x @ dx.ravel(), np.zeros(90)])
    dense = np.linalg.solve(np.block([[W, D.T], [D, np.zeros((90, 90))]]), right)[:114]
    assert distance(implicit(core, plant, plant.hold(), dx, dv), dense) < DENSE


# method coefficients
