"""Tests standing robots: balance of forces, agreement with eq. 1, and poses that do not exist."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.models import Robot, RobotError, load_robot
from hexapod_cosim.models.arrays import Array
from hexapod_cosim.models.contact.geometry import standing_damping
from hexapod_cosim.models.dynamics import Command, accelerations
from hexapod_cosim.models.kinematics import body_states
from hexapod_cosim.models.statics import Standing, settled, standing

# m/s2 and rad/s2: forces that balance to 1e-9 N accelerate the smallest inertias less than that
AT_REST = 1e-6
ROBOTS = ("athena", "phantomx_mk4")


def robot_on(
    name: str,
    *,
    mode: str = "position",
    kind: str = "flat",
    incline: float = 0.0,
    law: str = "tanh",
) -> Robot:
    robot = load_robot(name)
    terrain = replace(robot.terrain, kind=kind, incline=incline, heading=0.7, height=0.3)
    return replace(
        robot,
        servo=replace(robot.servo, mode=mode),
        friction=replace(robot.friction, law=law),
        terrain=terrain,
    )


def bodies(robot: Robot, pose: Standing) -> Array:
    return body_states(
        robot,
        pose.position,
        pose.quaternion,
        pose.velocity,
        np.zeros(3),
        pose.angle,
        np.zeros((6, 3)),
    )


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("mode", ["position", "kinematic"])
@pytest.mark.parametrize("incline", [0.0, 0.2])
@pytest.mark.parametrize("law", ["tanh", "bristle"])
def test_nothing_accelerates_in_the_standing_pose(
    name: str, mode: str, incline: float, law: str
) -> None:
    robot = robot_on(name, mode=mode, kind="slope", incline=incline, law=law)
    pose = standing(robot)
    body = bodies(robot, pose)
    result = accelerations(
        robot, body, Command(angle_ref=robot.stance), standing_damping(robot, body), pose.bristle
    )
    assert float(np.max(np.abs(result.dv))) < AT_REST


@pytest.mark.parametrize("name", ROBOTS)
def test_servos_sag_by_their_torque_over_their_stiffness_and_stay_within_limits(name: str) -> None:
    robot = robot_on(name)
    pose = standing(robot)
    body = bodies(robot, pose)
    torque = accelerations(
        robot, body, Command(angle_ref=robot.stance), standing_damping(robot, body)
    ).drive_torque
    assert robot.stance - pose.angle == pytest.approx(torque / robot.servo.kp, abs=1e-12)
    assert float(np.max(np.abs(torque))) < robot.servo.torque_continuous
    assert np.all(robot.angle_min < pose.angle)
    assert np.all(pose.angle < robot.angle_max)


def test_kinematic_servos_hold_the_stance_exactly() -> None:
    robot = robot_on("athena", mode="kinematic")
    assert standing(robot).angle == pytest.approx(robot.stance, abs=1e-9)


def test_a_pose_is_looked_up_for_an_equal_robot_and_cannot_be_changed() -> None:
    first, second = (standing(robot_on("athena")) for _ in range(2))
    assert second is first
    assert standing(robot_on("athena", mode="kinematic")) is not first
    with pytest.raises(ValueError, match="read-only"):
        first.angle[0, 0] = 0.0


@pytest.mark.parametrize("incline", [0.1, 0.3])
def test_on_a_slope_the_robot_creeps_downhill_at_the_speed_of_the_tanh_law(incline: float) -> None:
    robot = robot_on("athena", kind="slope", incline=incline)
    pose = standing(robot)
    creep = math.atanh(math.tan(incline) / robot.friction.mu) / robot.friction.slope
    downhill = -np.array(
        [math.cos(0.7) * math.cos(incline), math.sin(0.7) * math.cos(incline), math.sin(incline)]
    )
    assert pose.velocity == pytest.approx(creep * downhill, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("incline", [0.1, 0.3])
def test_on_a_slope_bristles_hold_the_robot_where_it_has_given_way_by_their_closed_form(
    incline: float,
) -> None:
    robot = robot_on("athena", kind="slope", incline=incline, law="bristle")
    pose = standing(robot)
    downhill = -np.array(
        [math.cos(0.7) * math.cos(incline), math.sin(0.7) * math.cos(incline), math.sin(incline)]
    )
    way = (
        robot.friction.presliding
        * 2.0
        * math.sin(math.asin(math.tan(incline) / robot.friction.mu) / 3.0)
    )  # u (3 - u^2)/2 = share
    assert not pose.velocity.any()
    assert pose.bristle == pytest.approx(np.tile(way * downhill, (6, 1)), rel=1e-6, abs=1e-6 * way)


@pytest.mark.parametrize("servo", [{"torque_max": 0.3, "torque_continuous": 0.3}], ids=["weak"])
def test_servos_that_cannot_hold_the_robot_are_refused(servo: dict[str, float]) -> None:
    robot = robot_on("athena")
    with pytest.raises(
        RobotError,
        match=r"athena: the robot does not stand: .*raise servo\.kp or servo\.torque_max",
    ):
        settled(replace(robot, servo=replace(robot.servo, **servo)))  # type: ignore[arg-type]


FRICTIONLESS = {
    "none": {"law": "none"},
    "tanh": {"law": "tanh", "mu": 0.0},
    "bristle": {"law": "bristle", "mu": 0.0},
}


def with_friction(robot: Robot, **friction: object) -> Robot:
    return replace(robot, friction=replace(robot.friction, **friction))  # type: ignore[arg-type]


@pytest.mark.parametrize("friction", FRICTIONLESS.values(), ids=FRICTIONLESS)
@pytest.mark.parametrize("mode", ["position", "kinematic"])
def test_on_level_ground_the_robot_stands_without_friction_as_with_it(
    friction: dict[str, object], mode: str
) -> None:
    """The servos hold the robot, so no foot pushes along the ground in the pose of rest."""
    robot = robot_on("athena", mode=mode)
    slippery = with_friction(robot, **friction)
    pose, held = standing(slippery), standing(robot)
    assert pose.angle == pytest.approx(held.angle, abs=1e-12)
    assert pose.position == pytest.approx(held.position, abs=1e-12)
    assert not pose.slide.any()
    body = bodies(slippery, pose)
    result = accelerations(
        slippery, body, Command(angle_ref=robot.stance), standing_damping(slippery, body)
    )
    assert float(np.max(np.abs(result.dv))) < AT_REST


@pytest.mark.parametrize(
    "friction", [*FRICTIONLESS.values(), {"mu": 0.2}, {"law": "bristle", "mu": 0.2}], ids=str
)
@pytest.mark.parametrize("mode", ["position", "kinematic"])
def test_a_slope_steeper_than_friction_holds_lets_the_robot_slide_as_one_body(
    friction: dict[str, float | str], mode: str
) -> None:
    """All bodies accelerate downhill by g (sin a - mu cos a) and none turns. On a slope of 0.4 rad
    this is 3.8202 or 2.0131 m/s2.
    """
    robot = with_friction(robot_on("athena", mode=mode, kind="slope", incline=0.4), **friction)
    pose = standing(robot)
    downhill = -np.array(
        [math.cos(0.7) * math.cos(0.4), math.sin(0.7) * math.cos(0.4), math.sin(0.4)]
    )
    size = 2.0131 if friction.get("mu") == 0.2 else 3.8202
    assert pose.slide == pytest.approx(size * downhill, abs=1e-4)
    fast = (
        10.0 * downhill if robot.friction.law == "tanh" else np.zeros(3)
    )  # m/s, at which the tanh law has its full friction
    body = body_states(
        robot, pose.position, pose.quaternion, fast, np.zeros(3), pose.angle, np.zeros((6, 3))
    )
    result = accelerations(
        robot, body, Command(angle_ref=robot.stance), standing_damping(robot, body), pose.bristle
    )
    assert float(np.max(np.abs(result.dv - np.concatenate([pose.slide, np.zeros(3)])))) < AT_REST
