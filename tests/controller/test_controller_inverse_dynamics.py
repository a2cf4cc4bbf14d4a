"""Tests the forces and torques that a planned motion requires against the multibody twin, body by
body, by virtual work.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from gains import PERIOD, weight
from states import changed, with_links
from twin_motion import HIGH, Motion, Z, twin_needs, velocities

from hexapod_cosim.controller import LegSolver
from hexapod_cosim.controller.walk.inverse_dynamics import Demand, InverseDynamics, Neighbours
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.actuator import GEAR_SPEED
from hexapod_cosim.models.dynamics import masses
from hexapod_cosim.models.kinematics import body_states, foot_centres

ROBOTS = ("athena", "phantomx_mk4", "sts3215_hexapod")
POINT = (1e-12, 1e-12, 1e-12, 0.0, 0.0, 0.0)  # kg m2; negligible, as of a point mass
# N, N m; second differences of 1 m have errors of 4 eps/h^2 = 4e-11 m/s2, times some kg
ROUND_OFF = 1e-9
# N m; the twin's axes turn by (h w)^2 = 3e-5 in a period, which acts on rotors of 0.01 kg m2 at 10
# rad/s2
SWEPT = 2e-6
SWINGING = np.array([True, False, True, False, True, False])


def wave(size: float, rate: float, at: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda t: size * np.sin(rate * t + at)


def moving(
    robot: Robot, *, turning: float, leaning: float, start: float, weight_ratio: float = 1.0
) -> tuple[Motion, Demand]:
    """Returns three time steps of a torso that sways, turns and leans over three standing feet
    while three others swing. weight_ratio: measured over modelled weight [1].
    """
    t = start + PERIOD * np.arange(-1.0, 2.0)
    legs = LegSolver(robot)
    home = legs.forward(robot.stance)
    way = 0.05 * t + wave(0.01, 6.0, 0.3)(t) + 1j * wave(0.008, 7.0, 1.0)(t)
    yaw = turning * wave(0.05, 5.0, 0.2)(t)
    posture = np.column_stack(
        [
            leaning * 0.004 * np.sin(5.0 * t),
            *(leaning * wave(0.05, rate, rate)(t) for rate in (4.0, 6.0)),
        ]
    )
    ground = home[:, 0] + 1j * home[:, 1] + SWINGING * wave(0.02, 8.0, 0.5)(t)[:, None]
    height = home[:, 2] + SWINGING * (0.02 + wave(0.015, 9.0, 0.1)(t)[:, None])
    plane = np.exp(-1j * yaw[:, None]) * (ground - way[:, None])
    dynamics, torsos = (
        InverseDynamics(robot, legs, period=PERIOD),
        [Posture.of(row, np.zeros(3)) for row in posture],
    )
    before, now, after = (
        legs.pose(*torso.to_torso(*foot))
        for torso, foot in zip(torsos, zip(plane, height, strict=True), strict=True)
    )
    masses = [
        dynamics.place(*step)
        for step in zip((before, now, after), way.tolist(), yaw.tolist(), torsos, strict=True)
    ]
    angle = np.array([before.angle, now.angle, after.angle])
    speed = np.gradient(angle, PERIOD, axis=0)
    demand = dynamics.demand(
        Neighbours((masses[0], masses[1], masses[2]), (before, now, after)),
        speed[1],
        torsos[1],
        weight_ratio,
    )
    return Motion(PERIOD, way, yaw, posture, angle, speed), demand


def differences(robot: Robot, motion: Motion, demand: Demand) -> dict[str, float]:
    """Returns the largest errors of a demand against the twin: push and weight [N], moment and
    torques [N m].
    """
    needed, body, _ = twin_needs(robot, motion, 1)
    floor = HIGH + LegSolver(robot).forward(robot.stance)[:, 2].mean() - robot.foot.radius
    below = np.array([motion.way[1].real, motion.way[1].imag, floor])
    moment = needed[3:6] + np.cross(body[0, :3] - below, needed[:3])
    back = np.exp(-1j * motion.yaw[1])
    servo, speed = robot.servo, motion.speed[1]
    gear = servo.coulomb_friction * np.tanh(speed / GEAR_SPEED) + servo.drag * speed
    torque = needed[6:].reshape(6, 3) + gear
    return {
        "push": abs(demand.push - back * complex(needed[0], needed[1])),
        "weight": abs(demand.weight - needed[2]),
        "moment": abs(demand.moment - back * complex(-moment[1], moment[0])),
        "twist": abs(demand.twist - moment[2]),
        "torque": float(np.abs(demand.torque - torque).max()),
    }


def points(robot: Robot, *, link: tuple[float, ...] = POINT) -> Robot:
    """Returns the robot with all its masses as points, or with its links' masses as balls."""
    robot = changed(robot, torso={"inertia": POINT})
    for joint in range(3):
        robot = with_links(robot, joint, inertia=link)
    return robot


STARTS = [0.1, 0.45, 0.77]


@pytest.mark.parametrize("weight_ratio", [1.0, 1.3, 2.5])
@pytest.mark.parametrize("name", ROBOTS)
def test_push_and_twist_under_a_measured_weight_are_those_of_a_payload_on_the_torso(
    name: str, weight_ratio: float
) -> None:
    """Its loads are the planned ones times the weight (C30); joint torques of legs stay (C56)."""
    robot = points(load_robot(name))
    payload = (weight_ratio - 1.0) * float(masses(robot).sum())  # kg
    heavier = changed(robot, torso={"mass": robot.torso.mass + payload})
    for start in STARTS:
        _, planned = moving(robot, turning=1.0, leaning=1.0, start=start, weight_ratio=weight_ratio)
        _, known = moving(heavier, turning=1.0, leaning=1.0, start=start)
        assert abs(weight_ratio * planned.push - known.push) < ROUND_OFF
        assert abs(weight_ratio * planned.twist - known.twist) < ROUND_OFF
        assert (planned.torque == known.torque).all()


@pytest.mark.parametrize("turning", [0.0, 1.0])
@pytest.mark.parametrize("leaning", [0.0, 1.0])
@pytest.mark.parametrize("name", ROBOTS)
def test_mass_points_need_what_the_twin_says_to_the_last_digit_that_differences_give(
    name: str, turning: float, leaning: float
) -> None:
    robot = points(load_robot(name))
    for start in STARTS:
        found = differences(robot, *moving(robot, turning=turning, leaning=leaning, start=start))
        assert max(found["push"], found["weight"], found["moment"], found["twist"]) < ROUND_OFF
        assert found["torque"] < SWEPT


@pytest.mark.parametrize("name", ROBOTS)
def test_the_lever_is_the_twins_virtual_work_of_a_force_on_the_contact_point(name: str) -> None:
    robot = load_robot(name)
    motion, demand = moving(robot, turning=1.0, leaning=0.0, start=0.3)
    body = motion.bodies(robot, 1)
    reach = velocities(robot, body, motion.angle[1]).reshape(19, 6, 24)
    axes = np.array(
        [
            [np.cos(motion.yaw[1]), np.sin(motion.yaw[1]), 0.0],
            [-np.sin(motion.yaw[1]), np.cos(motion.yaw[1]), 0.0],
            Z,
        ]
    )
    for leg, centre in enumerate(foot_centres(robot, body)):
        v, w = np.split(reach[3 * leg + 3, :, 6 + 3 * leg : 9 + 3 * leg], 2)
        arm = centre - robot.foot.radius * Z - body[3 * leg + 3, :3]
        np.testing.assert_allclose(
            demand.lever[leg], (v + np.cross(w.T, arm).T).T @ axes.T, atol=1e-12
        )


@pytest.mark.parametrize("name", ROBOTS)
def test_standing_needs_the_weight_its_moment_and_nothing_else(name: str) -> None:
    robot = load_robot(name)
    demand = InverseDynamics(robot, LegSolver(robot), period=PERIOD).rest()
    assert demand.weight == pytest.approx(weight(robot), rel=1e-14)
    assert demand.push == 0.0
    body = body_states(
        robot,
        np.array(robot.torso.com),
        np.array([1.0, 0.0, 0.0, 0.0]),
        np.zeros(3),
        np.zeros(3),
        robot.stance,
        np.zeros((6, 3)),
    )
    centre = masses(robot) @ body[:, :2] @ [1.0, 1.0j]
    assert demand.moment == pytest.approx(9.81 * centre, abs=1e-12)
