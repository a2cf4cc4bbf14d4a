"""Tests the O(n) solution of eq. 1 by the C plant against the dense 204 x 204 system and Pinocchio,
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
from test_twin_pinocchio import pinocchio_accelerations

from hexapod_cosim.models import CONTACT_LAWS, METHODS, Robot, load_robot
from hexapod_cosim.models.actuator import gear_friction
from hexapod_cosim.models.contact.geometry import foot_contacts, foot_force, standing_damping
from hexapod_cosim.models.contact.law import contact_damping
from hexapod_cosim.models.dynamics import (
    Command,
    accelerations,
    constraints,
    joint_torques,
    mass_matrix,
)
from hexapod_cosim.models.kinematics import (
    joint_speeds,
    quaternion_rate,
    skew,
)
from hexapod_cosim.models.records import Array

DENSE = 1e-10  # relative: the error of the dense solution, whose condition number is about 1e6
PINOCCHIO = 1e-9  # relative: the force of a foot 1e-4 m deep amplifies the rounding of its height
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


def test_the_accelerations_shown_are_the_rates_that_are_integrated(core: ct.CDLL) -> None:
    robot = lopsided(5)
    body, command = random_bodies(robot, 5, drift=0.01), random_command(robot, 5)
    plant = at(core, robot, body)
    rate, power = np.zeros((19, 13)), np.zeros(3)
    core.hx_probe_rate(
        ct.c_void_p(plant.handle),
        ct.byref(inputs(command)),
        ct.c_double(0.0),
        pointer(rate),
        pointer(power),
    )
    assert np.array_equal(rate[:, 7:13], plant.accelerations(command).dv)
    assert np.array_equal(rate[:, 0:3], body[:, 7:10])
    assert (
        distance(rate[:, 3:7], [quaternion_rate(state[3:7], state[10:13]) for state in body])
        < 1e-14
    )


@pytest.mark.parametrize("mode", MODES)
def test_powers_of_motors_push_and_losses_are_forces_times_speeds(core: ct.CDLL, mode: str) -> None:
    robot = changed(lopsided(6), servo={"mode": mode}, contact={"impact_speed_floor": 2.0})
    body, command = random_bodies(robot, 6), random_command(robot, 6)
    plant = at(core, robot, body)
    rate, power = np.zeros((19, 13)), np.zeros(3)
    core.hx_probe_rate(
        ct.c_void_p(plant.handle),
        ct.byref(inputs(command)),
        ct.c_double(0.0),
        pointer(rate),
        pointer(power),
    )
    speed, lost = joint_speeds(robot, body), 0.0
    for foot, damping in zip(
        foot_contacts(robot, body), standing_damping(robot, body), strict=True
    ):
        elastic = robot.contact.stiffness * max(foot.penetration, 0.0) ** 1.5
        lost -= (
            float(foot_force(robot, foot, damping) @ foot.velocity) + elastic * foot.approach_speed
        )
    lost -= float(np.sum(gear_friction(robot.servo, speed) * speed))
    pushed = float(command.push_force @ body[0, 7:10] + command.push_torque @ body[0, 10:13])
    assert power == pytest.approx(
        [float(np.sum(plant.accelerations(command).drive_torque * speed)), pushed, lost], rel=DENSE
    )


def test_a_kinematic_drive_follows_its_reference_on_from_when_it_was_given(core: ct.CDLL) -> None:
    robot = changed(lopsided(7), servo={"mode": "kinematic"})
    body, command = (
        random_bodies(robot, 7, drift=1e-3),
        replace(random_command(robot, 7), age=0.004),
    )
    plant = at(core, robot, body)
    rate, power = np.zeros((19, 13)), np.zeros(3)
    core.hx_probe_rate(
        ct.c_void_p(plant.handle),
        ct.byref(inputs(command)),
        ct.c_double(command.age),
        pointer(rate),
        pointer(power),
    )
    dense = accelerations(robot, body, command, standing_damping(robot, body))
    assert distance(rate[:, 7:13], dense.dv) < DENSE
    assert (
        distance(
            dense.dv,
            accelerations(robot, body, replace(command, age=0.0), standing_damping(robot, body)).dv,
        )
        > 1e3 * DENSE
    )


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
@pytest.mark.parametrize("mode", ["position", "torque"])
@pytest.mark.parametrize("terrain", ["flat", "slope"])
def test_forward_dynamics_agree_with_pinocchio(
    core: ct.CDLL, robot: Robot, mode: str, terrain: str
) -> None:
    robot = changed(
        robot,
        servo={"mode": mode},
        terrain={"kind": terrain, "height": 0.01, "incline": 0.2, "heading": 0.6},
    )
    for seed in range(4):
        body, command = random_bodies(robot, seed), random_command(robot, seed)
        plant = at(core, robot, body)
        foot = plant.output(command).foot
        motor, gear = joint_torques(robot, body, command)
        push = np.concatenate([command.push_force, command.push_torque])
        forces = np.stack([foot.position, foot.force], axis=1)
        dv = plant.accelerations(command).dv
        theirs = pinocchio_accelerations(robot, body, motor + gear, forces, push)
        assert np.count_nonzero(foot.normal_force) >= 3
        assert (
            distance(np.concatenate([dv[0], constraints(robot, body).G @ dv.ravel()]), theirs)
            < PINOCCHIO
        )


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


@pytest.mark.parametrize("method", METHODS)
def test_method_coefficients_satisfy_the_order_conditions(core: ct.CDLL, method: str) -> None:
    """Checks the conditions of a Rosenbrock-W method of order p with any matrix A: every tree of
    order <= p with some of its nodes taken implicitly.

    For a method whose A is computed anew at every stage, the change of A along the solution counts
    too.
    """
    shape, gamma = (ct.c_int * 3)(), ct.c_double()
    a, g, c, b, e = np.zeros((7, 7)), np.zeros((7, 7)), np.zeros(7), np.zeros(7), np.zeros(7)
    core.hx_probe_method(
        METHODS.index(method) + 1, shape, ct.byref(gamma), *map(pointer, (a, g, c, b, e))
    )
    stages, order, error_order = shape
    full = g + gamma.value * np.diag([1.0] * stages + [0.0] * (7 - stages))
    one, exact = np.ones(7), 1e-14
    assert c == pytest.approx(a @ one, abs=exact)
    for weights, accuracy in ((b, order), (b - e, error_order)):
        conditions = [(1, weights @ one, 1.0)]
        conditions += [(2, weights @ a @ one, 1.0 / 2.0), (2, weights @ full @ one, 0.0)]
        conditions += [
            (3, weights @ c**2, 1.0 / 3.0),
            (3, weights @ a @ c, 1.0 / 6.0),
            (3, weights @ a @ full @ one, 0.0),
        ]
        conditions += [
            (3, weights @ full @ c, 0.0),
            (3, weights @ full @ full @ one, 0.0),
            (3, (weights * c) @ full @ one, 0.0),
        ]
        conditions += [(4, weights @ c**3, 1.0 / 4.0), (4, weights @ (c * (a @ c)), 1.0 / 8.0)]
        conditions += [(4, weights @ a @ c**2, 1.0 / 12.0), (4, weights @ a @ a @ c, 1.0 / 24.0)]
        conditions += [
            (5, weights @ c**4, 1.0 / 5.0),
            (5, weights @ a @ c**3, 1.0 / 20.0),
            (5, weights @ a @ a @ a @ c, 1.0 / 120.0),
        ]
        for p, value, wanted in conditions:
            assert p > accuracy or value == pytest.approx(wanted, abs=exact), (p, accuracy)
