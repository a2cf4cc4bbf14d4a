"""Tests the readable twin of the integrator: its closed forms, and the steps of the C plant against
its steps.
"""

from __future__ import annotations

import ctypes as ct
import math
from typing import Any

import numpy as np
import pytest
from plant import Plant, pointer
from states import changed, distance, landing, lopsided, random_bodies, random_command, random_pose

from hexapod_cosim.models import METHODS, Robot, load_robot
from hexapod_cosim.models.actuator import servo_slopes
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.constraints import project
from hexapod_cosim.models.contact.geometry import foot_contacts
from hexapod_cosim.models.dynamics import Command
from hexapod_cosim.models.integrator import cubic_crossing, integrate, step_factor
from hexapod_cosim.models.kinematics import body_states, joint_angles, joint_speeds
from hexapod_cosim.models.method import METHOD, Stage, method_step
from hexapod_cosim.models.step import State, error_norm, start_state

PLACES = 1e-14  # m, 1: some tens of roundings
SPEEDS = 1e-11  # relative to the largest speed: the dense system of 204 unknowns loses four digits
IMPLICIT = ("rosw3", "ros2")
ORDER = {"rosw3": 3, "ros2": 2, "dp54": 5}
# s, for which all methods are stable
STEP = {"rosw3": 1e-3, "ros2": 1e-3, "dp54": 2e-5}
ONE = np.ones(1)


# the methods alone


@pytest.mark.parametrize("name", METHODS)
def test_the_rows_of_the_methods_are_those_of_the_plant(core: ct.CDLL, name: str) -> None:
    shape, gamma, m = (ct.c_int * 2)(), ct.c_double(), METHOD[name]
    a, g, c, b, e = np.zeros((7, 7)), np.zeros((7, 7)), np.zeros(7), np.zeros(7), np.zeros(7)
    places = map(pointer, (a, g, c, b, e))
    core.hx_probe_method(METHODS.index(name) + 1, shape, ct.byref(gamma), *places)
    s = m.stages
    assert list(shape) == [s, m.order]
    for of_plant, of_twin in ((a[:s, :s], m.a), (g[:s, :s], m.g), (c[:s], m.c), (b[:s], m.b)):
        assert distance(of_plant, of_twin) < 1e-15
    assert distance(e[:s], m.e) < 1e-15
    assert gamma.value == pytest.approx(m.gamma, abs=1e-15)


def w_stage(name: str, h: float, t_0: float, slope: float) -> Stage:
    """Takes a stage on y' = -2 t y^2 with A = slope y_i, which is not the derivative of f."""
    z = h * METHOD[name].gamma

    def stage(elapsed: float, y: Array, change: Array) -> Array:
        A = slope * y
        return np.asarray((-2.0 * (t_0 + elapsed) * y**2 + A * change) / (1.0 - z * A))

    return stage


@pytest.mark.parametrize("slope", [0.0, -0.7])
@pytest.mark.parametrize("name", METHODS)
def test_each_method_has_its_order_with_a_wrong_matrix_that_moves(name: str, slope: float) -> None:
    """y = 1/(1 + t^2) solves y' = -2 t y^2. Explicit methods do not use A."""
    errors, counts = [], np.array([16, 32, 64])
    for n in counts:
        y, h = ONE, 1.0 / n
        for i in range(n):
            used = slope if name in IMPLICIT else 0.0
            y, _ = method_step(METHOD[name], w_stage(name, h, i * h, used), y, h)
        errors.append(abs(float(y[0]) - 0.5))
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order == pytest.approx(ORDER[name], abs=0.25)


def amplified(name: str, matrix: Array, y: Array) -> Array:
    """Returns y_1 of y' = matrix y over h = 1 with the exact matrix A."""
    m = METHOD[name]
    W = np.eye(len(y)) - m.gamma * matrix

    def stage(elapsed: float, y_i: Array, change: Array) -> Array:
        return np.asarray(np.linalg.solve(W, matrix @ (y_i + change)), dtype=np.float64)

    return method_step(m, stage, y, 1.0)[0]


@pytest.mark.parametrize("name", IMPLICIT)
def test_stiff_linear_motion_is_damped_at_once_and_oscillation_never_grows(name: str) -> None:
    """L-stability: the amplification R tends to 0 at minus infinity. A-stability: |R(i w)| <= 1 for
    every w.
    """
    assert abs(float(amplified(name, np.array([[-1e8]]), ONE)[0])) < 1e-7
    for w in np.logspace(-2, 4, 61):
        turn = np.array([[0.0, -w], [w, 0.0]])
        assert np.linalg.norm(amplified(name, turn, np.array([1.0, 0.0]))) <= 1.0 + 1e-12


# step sizes and touch-downs alone


def test_the_step_factor_aims_at_the_tolerance_within_its_limits() -> None:
    assert step_factor(METHOD["rosw3"], 1.0) == pytest.approx(0.9)
    assert step_factor(METHOD["rosw3"], 0.729) == pytest.approx(1.0)  # 0.9^3
    assert step_factor(METHOD["ros2"], 8.1e-1) == pytest.approx(1.0)  # 0.9^2
    assert step_factor(METHOD["dp54"], 0.0) == step_factor(METHOD["dp54"], 1e-9) == 5.0
    assert step_factor(METHOD["dp54"], 1e9) == step_factor(METHOD["dp54"], math.nan) == 0.2


def test_an_error_counts_by_its_scale_and_quaternions_by_their_joints_axes() -> None:
    """A coxa's axes a, b, s are its link's axes turned by 90 degrees about z, so an error of 1
    counts as 0.7071.
    """
    robot = changed(load_robot("athena"), solver={"tolerance": 1e-3})
    for row, entry, expected in [
        (0, 0, 1e4),  # 0.1 m
        (5, 8, 1e3),  # 1 m/s
        (5, 12, 1e2),  # 10 rad/s
        (0, 3, 1e3),
        (1, 3, 707.10678),
    ]:
        estimate = np.zeros(19 * 13 + 18)
        estimate[13 * row + entry] = 1.0
        assert error_norm(robot, estimate) == pytest.approx(expected)


def test_a_cubic_is_crossed_where_it_reaches_the_level() -> None:
    assert cubic_crossing(0.0, 0.0, 1.0, 3.0, 0.125) == pytest.approx(0.5, abs=1e-13)  # x^3
    assert cubic_crossing(-1.0, 2.0, 1.0, 2.0, 0.0) == pytest.approx(0.5, abs=1e-13)  # 2 x - 1


def test_a_falling_robot_touches_down_when_and_as_fast_as_a_stone() -> None:
    """Without torques the robot only falls. A touch-down is found to 1e-10 m."""
    solver = {"method": "dp54", "step": 0.02}
    robot = changed(load_robot("athena"), servo={"mode": "torque"}, solver=solver)
    still = np.zeros(3)
    rest = body_states(robot, still, np.eye(4)[0], still, still, robot.stance, np.zeros((6, 3)))
    fall, g = 1e-3, -robot.gravity[2]
    rest[:, 2] += max(foot.penetration for foot in foot_contacts(robot, rest)) + fall
    landed = integrate(robot, Command(angle_ref=robot.stance), start_state(robot, rest), 0.0143)
    assert landed.touchdowns == 6
    assert landed.impact_speed == pytest.approx(math.sqrt(2.0 * g * fall), rel=1e-6)
    assert math.sqrt(2.0 * fall / g) == pytest.approx(0.01428, abs=1e-5)


def test_bodies_on_their_joints_stay_there_when_projected_and_drifted_ones_return() -> None:
    robot = lopsided()
    body = body_states(robot, **random_pose(robot, 1))
    assert distance(project(robot, body), body) < PLACES * 10.0
    drifted = project(robot, random_bodies(robot, 1, drift=1e-3))
    torso = (drifted[0, 0:3], drifted[0, 3:7], drifted[0, 7:10], drifted[0, 10:13])
    joints = (joint_angles(robot, drifted), joint_speeds(robot, drifted))
    on_joints = body_states(robot, *torso, *joints)
    on_joints[:, 3:7] *= np.sign(np.sum(on_joints[:, 3:7] * drifted[:, 3:7], axis=1))[:, None]
    assert distance(drifted, on_joints) < PLACES * 10.0


# the stages of a robot


# the C plant's steps


def assert_same_steps(
    core: ct.CDLL, robot: Robot, body: Array, command: Command, ends: list[float]
) -> State:
    """Asserts that the plant and the twin, from these bodies to the ends [s], have the same motion,
    contacts and counts of the solver.
    """
    plant, state = Plant(core, robot), start_state(robot, body)
    plant.bodies = body
    for t in ends:
        plant.step(t, command)
        state = integrate(robot, command, state, t)
    output, bodies = plant.output(command), plant.bodies
    assert distance(bodies[:, 0:7], state.body[:, 0:7]) < PLACES
    assert distance(bodies[:, 7:13], state.body[:, 7:13]) < SPEEDS
    assert distance(output.foot.bristle, state.bristle) < PLACES
    assert distance(output.foot.impact_speed, state.impact_speed) < SPEEDS
    assert np.array_equal(output.foot.contact != 0, ~np.isnan(state.damping))
    counts = (state.evaluations, state.steps, state.rejected, state.touchdowns)
    assert counts == tuple(int(x) for x in vars(output.solver).values())
    assert plant.time == state.time == ends[-1]
    return state


@pytest.mark.parametrize(
    ("name", "friction"),
    [(name, law) for name in METHODS for law in ("tanh", "bristle")] + [("rosw3", "none")],
)
def test_steps_in_contact_are_the_plants(core: ct.CDLL, name: str, friction: str) -> None:
    h = STEP[name]
    robot = changed(lopsided(), solver={"method": name, "step": h}, friction={"law": friction})
    body, command = random_bodies(robot, 1), random_command(robot, 1)
    state = assert_same_steps(core, robot, body, command, [h, 2.0 * h])
    assert np.count_nonzero(~np.isnan(state.damping)) == 3


@pytest.mark.parametrize("name", [*IMPLICIT, "dp54"])
@pytest.mark.parametrize("mode", ["torque", "kinematic"])
def test_steps_with_other_drives_are_the_plants(core: ct.CDLL, name: str, mode: str) -> None:
    h = STEP[name]
    robot = changed(load_robot("athena"), solver={"method": name, "step": h}, servo={"mode": mode})
    assert_same_steps(core, robot, random_bodies(robot, 1), random_command(robot, 1), [h, 2.0 * h])


@pytest.mark.parametrize("name", METHODS)
def test_steps_on_the_torque_speed_line_are_the_plants(core: ct.CDLL, name: str) -> None:
    h = STEP[name]
    robot = changed(lopsided(), solver={"method": name, "step": h})
    ways = np.random.default_rng(5).choice([-1.0, 1.0], (6, 3))
    fast = {"speed": 0.6 * robot.servo.speed_max * ways, "position": np.array([0.0, 0.0, 2.0])}
    body = body_states(robot, **(random_pose(robot, 1) | fast))
    command = Command(angle_ref=robot.stance + 3.0 * ways)
    refs = (command.angle_ref, command.speed_ref, command.torque_ref)
    angle, speed = joint_angles(robot, body), joint_speeds(robot, body)
    _, damping = servo_slopes(robot.servo, angle, speed, *refs)
    assert np.all(damping == robot.servo.torque_max / robot.servo.speed_max)
    assert_same_steps(core, robot, body, command, [2.0 * h])


@pytest.mark.parametrize("name", IMPLICIT)
def test_projected_steps_of_drifted_bodies_are_the_plants(core: ct.CDLL, name: str) -> None:
    solver = {"method": name, "step": 1e-3, "projection": "step"}
    robot = changed(lopsided(), solver=solver, friction={"law": "bristle", "mu_static": 0.9})
    body = random_bodies(robot, 1, drift=1e-4)
    assert_same_steps(core, robot, body, random_command(robot, 1), [2e-3])


@pytest.mark.parametrize(
    ("name", "tolerance", "friction"),
    [
        ("rosw3", 2e-6, {"law": "tanh"}),
        ("ros2", 2e-6, {"law": "tanh"}),
        ("dp54", 2e-9, {"law": "tanh"}),
        # error of the bristles decides the step size
        ("rosw3", 2e-6, {"law": "bristle", "presliding": 1e-6}),
    ],
)
def test_controlled_steps_through_a_touch_down_are_the_plants(
    core: ct.CDLL, name: str, tolerance: float, friction: dict[str, Any]
) -> None:
    """The twin tries, rejects and accepts the same steps and makes the same guesses of the
    touch-down time.
    """
    solver = {"method": name, "step": 0.0, "tolerance": tolerance}
    robot = changed(load_robot("athena"), solver=solver, friction=friction)
    body = body_states(robot, **landing(robot))
    body[:, 2] -= 1.9e-3  # m, height above the ground: 0.1 mm is left
    command = random_command(robot, 3)
    state = assert_same_steps(core, robot, body, command, [2e-4, 4e-4])
    assert state.touchdowns == 1
    assert state.rejected > 0
