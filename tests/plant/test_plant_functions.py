"""Compares the C plant with the readable twin, function by function, on random states."""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from plant import Plant, asked, inputs, probed
from states import DRIFT, changed, distance, drifted, lopsided

from hexapod_cosim.models import CONTACT_LAWS, load_robot
from hexapod_cosim.models.actuator import gear_friction, servo_torque
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import joint_kinematics
from hexapod_cosim.models.contact.law import contact_damping, exact_restitution_chi, normal_force
from hexapod_cosim.models.dynamics import world_inertias
from hexapod_cosim.models.kinematics import (
    body_states,
    joint_angle,
    joint_models,
    joint_speed,
    rotation_matrix,
    skew,
)
from hexapod_cosim.models.servos.motor import Power

# relative: the same formula with its operations in another order, some hundred roundings
SAME = 1e-13
LEG_JOINTS = [(leg, joint) for leg in range(6) for joint in range(3)]


# rotations and frames


def test_inertias_are_taken_to_another_point_by_the_congruence(core: ct.CDLL) -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        c, U, s, mass = (
            rng.normal(size=3),
            rng.normal(size=6),
            float(rng.normal()),
            float(rng.uniform(0.1, 2.0)),
        )
        J, A = (root @ root.T for root in rng.normal(size=(2, 3, 3)))
        X = np.eye(6)
        X[3:6, 0:3] = -skew(c)  # v at c = v + w x c
        s = -abs(s)  # the difference stays positive definite
        at_c = np.block([[J, np.zeros((3, 3))], [np.zeros((3, 3)), mass * np.eye(3) + A]])
        body, less, whole, inverse = probed(
            core.hx_probe_inertia, mass, J, A, c, s, U, size=144
        ).reshape(4, 6, 6)
        rigid = np.block([[J, np.zeros((3, 3))], [np.zeros((3, 3)), mass * np.eye(3)]])
        expected = X.T @ at_c @ X - s * np.outer(U, U)
        assert distance(body, X.T @ rigid @ X) < SAME
        assert distance(less, X.T @ rigid @ X - s * np.outer(U, U)) < SAME
        assert distance(whole, expected) < SAME
        assert distance(inverse, np.linalg.inv(expected)) < SAME * np.linalg.cond(expected)


# joints, eq. 2-4


@pytest.mark.parametrize("seed", range(3))
def test_joint_kinematics_are_the_twins_on_drifted_joints(core: ct.CDLL, seed: int) -> None:
    robot = lopsided(seed)
    plant, body = drifted(core, robot, seed)
    inertias = world_inertias(robot, body)
    for (leg, joint), model in zip(LEG_JOINTS, joint_models(robot), strict=True):
        parent, child = body[model.parent], body[model.child]
        ours = joint_kinematics(model, parent, child)
        J, R_j = inertias[model.child], rotation_matrix(child[3:7])
        expected = np.concatenate(
            [
                ours.phi,
                ours.dphi,
                ours.s,
                rotation_matrix(parent[3:7]) @ model.point_i,
                R_j @ model.point_j,
                [joint_angle(model, parent, child), joint_speed(model, parent, child)],
                J[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
            ]
        )
        got = probed(core.hx_probe_joint, plant, inputs(plant.hold()), leg, joint, size=27)
        assert distance(got, expected) < SAME
        assert float(np.max(np.abs(ours.phi))) > DRIFT / 10.0


def test_bodies_start_on_their_joints_where_the_twin_puts_them(core: ct.CDLL) -> None:
    robot, rng = lopsided(4), np.random.default_rng(4)
    start = {
        "position": rng.normal(size=3),
        "quaternion": rng.normal(size=4),
        "velocity": rng.normal(size=3),
        "angular_velocity": rng.normal(size=3),
        "angle": rng.uniform(-3.1, 3.1, (6, 3)),
        "speed": rng.normal(0.0, 5.0, (6, 3)),
    }
    plant = Plant(core, robot, **start)
    assert distance(plant.bodies, body_states(robot, **start)) < SAME
    output = plant.output()
    assert distance(output.angle, start["angle"]) < SAME
    assert distance(output.speed, start["speed"]) < SAME


def test_bodies_come_back_as_they_were_set(core: ct.CDLL) -> None:
    plant, body = drifted(core, load_robot("athena"), 5)
    assert distance(plant.bodies, body) < SAME
    # the plant keeps quaternions in the axes of the joints, so they round
    others = [0, 1, 2, *range(7, 13)]
    assert np.array_equal(plant.bodies[:, others], body[:, others])


# ground and feet, eq. 14-15


@pytest.mark.parametrize("law", CONTACT_LAWS)
def test_the_normal_force_is_the_twins_and_its_slopes_are_its_derivatives(
    core: ct.CDLL, law: str
) -> None:
    robot = changed(
        load_robot("athena"), contact={"law": law, "restitution": 0.6, "damping_factor": 2.0}
    )
    plant, rng = Plant(core, robot), np.random.default_rng(8)
    for impact in (0.0, 0.005, 0.3):
        damping = contact_damping(robot.contact, impact)
        assert asked(core.hx_probe_contact_damping, plant, impact) == pytest.approx(
            damping, rel=SAME
        )
        for delta, ddelta in zip(
            rng.uniform(-1e-3, 2e-3, 20).tolist(), rng.normal(0.0, 0.3, 20).tolist(), strict=True
        ):
            force, elastic, stiffness, viscosity = normal_probe(core, plant, damping, delta, ddelta)
            assert force == pytest.approx(
                normal_force(robot.contact, damping, delta, ddelta), rel=SAME
            )
            assert elastic == pytest.approx(normal_force(robot.contact, 0.0, delta, 0.0), rel=SAME)
            ends = [
                [
                    normal_force(robot.contact, damping, delta + sign * h, ddelta + sign * k)
                    for sign in (1.0, -1.0)
                ]
                for h, k in ((1e-9, 0.0), (0.0, 1e-7))
            ]
            slopes = [
                (up - down) / width for (up, down), width in zip(ends, (2e-9, 2e-7), strict=True)
            ]
            assert [stiffness, viscosity] == pytest.approx(slopes, rel=1e-5, abs=1e-4)
            assert normal_probe(core, plant, damping, delta, ddelta, closed=0.0)[
                :2
            ] == pytest.approx([0.0, 0.0], abs=0.0)


def normal_probe(
    core: ct.CDLL, plant: Plant, damping: float, delta: float, ddelta: float, *, closed: float = 1.0
) -> Array:
    return probed(core.hx_probe_normal_force, plant, closed, damping, delta, ddelta, size=4)


@pytest.mark.parametrize("e", [1e-3, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.9999, 1.0])
def test_the_exact_restitution_factor_is_the_twins(core: ct.CDLL, e: float) -> None:
    # both sides of the equation are of the size of chi and differ by chi^3; near e = 1 half of the
    # digits are lost
    rounding = 3e-8
    assert asked(core.hx_probe_exact_restitution_chi, e) == pytest.approx(
        exact_restitution_chi(e), rel=1e-9, abs=rounding
    )


# servos


@pytest.mark.parametrize("mode", ["position", "torque"])
def test_the_servo_is_the_twins_and_its_slopes_are_its_derivatives(
    core: ct.CDLL, mode: str
) -> None:
    robot = changed(load_robot("athena"), servo={"mode": mode})
    servo, plant, rng, clipped = robot.servo, Plant(core, robot), np.random.default_rng(9), 0
    for q, qd, command in zip(
        rng.normal(0.0, 0.1, 200),
        rng.normal(0.0, 4.0, 200),
        rng.normal(0.0, 1.0, (200, 3)) * [0.1, 4.0, 2.0],
        strict=True,
    ):
        strength = float(rng.choice((1.0, 0.3, 0.0)))

        def torque(
            angle: float, speed: float, refs: Array = command, given: float = strength
        ) -> float:
            at = np.array([[angle], [speed], *refs[:, None]])
            return float(servo_torque(servo, *at, power=Power(1.0, 1.0, given))[0])

        def total(speed: float, angle: float = q) -> float:
            return torque(angle, speed) + float(gear_friction(servo, np.array([speed]))[0])

        asked = np.append(command, [1.0, strength])
        got = probed(core.hx_probe_servo, plant, float(q), float(qd), asked, size=4)
        assert got[:2] == pytest.approx(
            [torque(q, qd), float(gear_friction(servo, np.array([qd]))[0])], rel=SAME
        )
        assert got[2] == pytest.approx(
            (torque(q - 1e-6, qd) - torque(q + 1e-6, qd)) / 2e-6, rel=1e-6, abs=1e-6
        )
        clipped += got[2] == 0.0
        if (
            got[2] > 0.0
            # on the torque-speed line the plant omits the damping on purpose
        ):
            assert got[3] == pytest.approx(
                (total(qd - 1e-6) - total(qd + 1e-6)) / 2e-6, rel=1e-5, abs=1e-5
            )
    assert clipped > 20
