"""Compares the plant's measures of one step with models/measure.py, whose impulses come from the
stages of an explicit method.
"""

from __future__ import annotations

import ctypes as ct

import numpy as np
import pytest
from plant import Plant
from slopes import rates
from states import changed, lopsided, random_command, random_pose
from test_laws_impact import above

from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.actuator import gear_friction, servo_torque
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import foot_contacts, foot_force, standing_damping
from hexapod_cosim.models.contact.law import contact_damping
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.kinematics import joint_angles, joint_speeds
from hexapod_cosim.models.measure import (
    Impulses,
    measure_cone,
    measure_feet,
    measure_joints,
    measure_landing,
    push_work,
    step_works,
)
from hexapod_cosim.models.method import METHOD

OF_JOINTS = ("positive_work", "negative_work", "torque_squared")
OF_FEET = ("slip_distance", "impulse", "peak_force", "peak_force_rate")
H = 2e-4  # s
SAME = 1e-9  # relative: differences of depths and angles over a step lose some digits


def stage_forces(
    robot: Robot, body: Array, command: Command, damping: Array
) -> tuple[Array, Array, Array]:
    """Returns motor and gear torques (6, 3) each and the forces on the feet (6, 3) for bodies (19,
    13).
    """
    angle, speed = joint_angles(robot, body), joint_speeds(robot, body)
    motor = servo_torque(
        robot.servo, angle, speed, command.angle_ref, command.speed_ref, command.torque_ref
    )
    feet = np.array(
        [
            foot_force(robot, foot, damping[leg])
            for leg, foot in enumerate(foot_contacts(robot, body))
        ]
    )
    return motor, gear_friction(robot.servo, speed), feet


@pytest.mark.parametrize("seed", [2, 5, 11])
@pytest.mark.parametrize("terrain", [{}, {"kind": "slope", "incline": 0.2, "heading": 0.7}])
def test_a_step_s_measures_are_those_of_the_readable_equations(
    core: ct.CDLL, seed: int, terrain: dict[str, object]
) -> None:
    robot = changed(
        lopsided(seed),
        solver={"method": "dp54", "step": H},
        terrain=terrain,
        servo={"torque_max": 3.0, "speed_max": 8.0},
        friction={"slope": 0.3},  # sliding feet use part of their friction cones
    )
    command = random_command(robot, seed)
    plant, there = (Plant(core, robot, **random_pose(robot, seed)) for _ in range(2))
    before, damping = plant.bodies, standing_damping(robot, plant.bodies)
    m, rate = METHOD["dp54"], rates(core, there, command)
    k, sums = np.zeros((7, 247)), [np.zeros((6, 3)) for _ in range(3)]
    for i in range(m.stages):
        y = before.ravel() + H * m.a[i] @ k
        k[i] = rate(y)
        forces = stage_forces(robot, y.reshape(19, 13), command, damping)
        sums = [total + H * m.b[i] * force for total, force in zip(sums, forces, strict=True)]
    plant.step(H, command)
    output, after = plant.output(command), plant.bodies
    works = step_works(robot, before, after, H, Impulses(*sums), ~np.isnan(damping))
    cone = measure_cone(robot, before, after, H, Impulses(*sums))
    np.testing.assert_allclose(output.cone_time, cone, rtol=0.0, atol=1e-15)
    assert float(np.sum(output.cone_time[:30])) > 0.0

    assert int(np.count_nonzero(~np.isnan(damping))) > 1
    pushed = H * np.concatenate([command.push_force, command.push_torque])
    parts = {
        "push_work": push_work(before, after, pushed),
        "contact_loss": works.contact,
        "friction_loss": works.friction,
        "gear_loss": works.gear,
        "actuator_work": float(np.sum(works.motor)),
    }
    for name, got in parts.items():
        assert getattr(output.energy, name) == pytest.approx(got, rel=1e-6, abs=1e-9), name
    joints = measure_joints(robot, before, after, H, command, works.motor)
    for name, expected in zip(OF_JOINTS, joints, strict=True):
        np.testing.assert_allclose(
            getattr(output, name), expected, rtol=SAME, atol=1e-9, err_msg=name
        )
    feet = measure_feet(robot, before, after, H, damping)
    for name, expected in zip(OF_FEET, feet, strict=True):
        np.testing.assert_allclose(
            getattr(output.foot, name),
            expected,
            rtol=1e-6,
            atol=1e-6 * float(np.max(expected)),
            err_msg=name,
        )


def step_ends(plant: Plant, duration: float, h: float) -> tuple[Array, Array]:
    """Returns the ends of fixed steps of h [s], which touch-downs split.

    The result is the times (n,) [s] and, for each foot, penetration, approach speed, whether it is
    closed, and impact speed (n, 4, 6).
    """
    command, times, feet = plant.hold(), [], []
    for k in range(1, round(duration / h) + 1):
        while plant.time < k * h:
            plant.step_to_event(k * h, command)
            foot = plant.output(command).foot
            times.append(plant.time)
            feet.append(
                [foot.penetration, -np.array(foot.velocity)[:, 2], foot.contact, foot.impact_speed]
            )
    return np.array(times), np.array(feet, dtype=float)


@pytest.mark.parametrize(
    "restitution", [0.1, 0.9]
)  # the feet stay on the ground with 0.1, and bounce within 20 ms with 0.9
def test_the_rise_of_a_landing_is_that_of_the_readable_equations(
    core: ct.CDLL, restitution: float
) -> None:
    """A robot is dropped with roll and pitch rates, so no two feet land alike, in steps that are no
    multiple of 0.1 ms.
    """
    settings = {"law": "exact_restitution", "restitution": restitution}
    robot = changed(
        load_robot("athena"), contact=settings, solver={"method": "dp54", "step": 2.3e-4}
    )
    plant = Plant(
        core,
        robot,
        position=above(robot, 2e-3),
        velocity=(0.0, 0.0, -0.1),
        angular_velocity=(0.1, 0.05, 0.0),
    )
    time, feet = step_ends(plant, 0.06, 2.3e-4)
    output = plant.output()
    expected, landed = [], feet[:, 2] > 0.0
    for leg in range(6):
        first = 1 + int(np.flatnonzero(landed[1:, leg] & ~landed[:-1, leg])[-1])
        delta, ddelta, closed, speed = feet[first:, :, leg].T
        damping = [
            contact_damping(robot.contact, v) if on else np.nan
            for on, v in zip(closed[:-1], speed, strict=False)
        ]
        expected.append(measure_landing(robot, time[first:], delta, ddelta, np.array(damping)))
    assert min(expected) > 100.0
    assert len({round(each) for each in expected}) == 6
    np.testing.assert_allclose(output.foot.landing_rate, expected, rtol=1e-6)
    assert (max(output.foot.landings) > 1.0) == (restitution == 0.9)
