"""Tests the closed-form kinematics of the legs against the twin's rotations, differences and each
other, and the transformation of feet from the walking frame to the torso's frame.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.controller import LegSolver
from hexapod_cosim.controller.walk.kinematics import Feet, Joints
from hexapod_cosim.controller.walk.posture import Posture
from hexapod_cosim.models import ReachError, Robot, RobotError, foot_positions, load_robot
from hexapod_cosim.models.kinematics import axis_rotation

ROUND_OFF = 1e-12  # m, rad; a dozen operations on numbers of order 1
STEP = 1e-6  # rad, step of central differences: truncation 1e-12, round-off 1e-10
DIFFERENCE_ERROR = 1e-8  # m/rad
POSES = 200


def robots() -> list[Robot]:
    """Returns the two packaged robots, and one whose legs differ and have sideways offsets."""
    athena = load_robot("athena")
    legs = list(athena.legs)
    coxa, femur, tibia = legs[1].links
    odd = (
        replace(coxa, offset_y=0.01, offset_z=-0.02),
        replace(femur, length=0.13, offset_y=-0.03),
        replace(tibia, offset_z=0.02),
    )
    legs[1] = replace(legs[1], links=odd)
    return [athena, load_robot("phantomx_mk4"), replace(athena, name="odd", legs=tuple(legs))]


@pytest.fixture(params=robots(), ids=lambda robot: robot.name)
def robot(request: pytest.FixtureRequest) -> Robot:
    found: Robot = request.param
    return found


def reachable_poses(robot: Robot, count: int = POSES) -> np.ndarray:
    """Returns random joint angles within the limits, with the knee up and the foot outside the coxa
    axis.

    There the inverse is unique.
    """
    solver, generator = LegSolver(robot), np.random.default_rng(7)
    found: list[np.ndarray] = []
    while len(found) < count:
        angle = generator.uniform(solver.angle_min, solver.angle_max)
        knee = angle[:, 2] + solver.femur_tilt - solver.tibia_tilt
        outward = solver.coxa_length + solver.femur * np.cos(angle[:, 1] + solver.femur_tilt)
        outward += solver.tibia * np.cos(angle[:, 1] - angle[:, 2] + solver.tibia_tilt)
        good = (knee > 0.05) & (knee < np.pi - 0.05) & (outward > 0.02)
        angle[~good] = solver.inverse(solver.forward(robot.stance))[~good]
        found.append(angle)
    return np.array(found)


def plane(rows: np.ndarray) -> np.ndarray:
    """Returns x + i y of rows (..., 3)."""
    return np.asarray(rows[..., 0] + 1j * rows[..., 1])


def solved(solver: LegSolver, foot: np.ndarray, velocity: np.ndarray) -> Joints:
    """Returns joint angles and speeds for positions and velocities of feet (n, 6, 3)."""
    return solver.solve(solver.pose(plane(foot), foot[..., 2]), plane(velocity), velocity[..., 2])


def test_forward_kinematics_are_the_twins(robot: Robot) -> None:
    for angle in reachable_poses(robot, 20):
        np.testing.assert_allclose(
            LegSolver(robot).forward(angle), foot_positions(robot, angle), atol=ROUND_OFF
        )


def test_the_inverse_of_forward_is_the_identity(robot: Robot) -> None:
    solver = LegSolver(robot)
    for angle in reachable_poses(robot):
        np.testing.assert_allclose(
            solver.inverse(solver.forward(angle)), angle, atol=1e-9
        )  # arccos loses digits near a straight leg


def test_the_jacobian_is_the_slope_of_forward_kinematics(robot: Robot) -> None:
    solver = LegSolver(robot)
    for angle in reachable_poses(robot, 20):
        jacobian = solver.jacobian(angle)
        for joint in range(3):
            nudge = np.zeros((6, 3))
            nudge[:, joint] = STEP
            slope = (solver.forward(angle + nudge) - solver.forward(angle - nudge)) / (2.0 * STEP)
            np.testing.assert_allclose(jacobian[:, :, joint], slope, atol=DIFFERENCE_ERROR)


def test_a_pose_says_where_the_links_point(robot: Robot) -> None:
    """Computes foot and knee from the directions of the links and compares them with the forward
    kinematics of the angles.
    """
    solver, foot = LegSolver(robot), LegSolver(robot).forward(reachable_poses(robot, 50))
    pose = solver.pose(plane(foot), foot[..., 2])
    for direction in (pose.heading, pose.femur, pose.tibia):
        np.testing.assert_allclose(np.abs(direction), 1.0, atol=ROUND_OFF)
    np.testing.assert_allclose(
        pose.foot, solver.femur * pose.femur + solver.tibia * pose.tibia, atol=ROUND_OFF
    )
    outward = pose.heading * (solver.coxa_length + pose.foot.real + 1j * solver.offset_y)
    np.testing.assert_allclose(outward, pose.point, atol=ROUND_OFF)
    np.testing.assert_allclose(solver.place + pose.point, plane(foot), atol=ROUND_OFF)
    np.testing.assert_allclose(
        solver.hip[2] + solver.coxa_height + pose.foot.imag, foot[..., 2], atol=ROUND_OFF
    )


def test_joint_speeds_are_the_jacobians_inverse_times_foot_velocity(robot: Robot) -> None:
    solver, generator = LegSolver(robot), np.random.default_rng(3)
    poses = reachable_poses(robot, 50)
    velocity = generator.normal(size=(50, 6, 3)) * 0.02
    joints = solved(solver, solver.forward(poses), velocity)
    expected = np.array(
        [
            np.linalg.solve(solver.jacobian(q), v[:, :, None])[:, :, 0]
            for q, v in zip(poses, velocity, strict=True)
        ]
    )
    slow = np.abs(expected).max(axis=-1) < robot.servo.speed_max
    assert slow.sum() > 100
    np.testing.assert_allclose(joints.speed[slow], expected[slow], rtol=1e-7, atol=1e-9)
    assert not joints.unreachable.any()
    assert np.abs(joints.speed).max() <= robot.servo.speed_max


@pytest.mark.parametrize(("leg", "name"), [(0, "LF"), (4, "RM")])
def test_a_foot_out_of_reach_is_refused_with_leg_target_and_reach(leg: int, name: str) -> None:
    robot = load_robot("athena")
    solver = LegSolver(robot)
    foot = solver.forward(robot.stance)
    foot[leg] = [0.6, 0.1, 0.0]
    with pytest.raises(
        ReachError, match=f"leg {name}.*0\\.6, 0\\.1, 0\\.0.*0\\.0600 to 0\\.2600 m"
    ) as caught:
        solver.inverse(foot)
    assert caught.value.got == (0.6, 0.1, 0.0)


def test_a_foot_beyond_a_joint_limit_is_refused() -> None:
    robot = load_robot("athena")
    solver = LegSolver(robot)
    angle = robot.stance
    angle[2, 0] = solver.angle_max[2, 0] + 0.1
    with pytest.raises(ReachError, match="leg LR"):
        solver.inverse(solver.forward(angle))


def test_solve_stays_within_the_limits_and_flags_the_leg() -> None:
    robot = load_robot("athena")
    solver = LegSolver(robot)
    foot = solver.forward(robot.stance)
    foot[0] *= 3.0
    foot[5] = solver.hip[:, 5]  # on the axis of the coxa
    joints = solved(solver, foot[None], np.tile([0.1, 0.0, 0.0], (1, 6, 1)))
    assert joints.unreachable.tolist() == [[True, False, False, False, False, True]]
    assert (joints.angle >= solver.angle_min).all()
    assert (joints.angle <= solver.angle_max).all()
    assert np.isfinite(joints.speed).all()


def test_another_axis_pattern_is_refused() -> None:
    robot = load_robot("athena")
    legs = list(robot.legs)
    coxa, femur, tibia = legs[3].links
    legs[3] = replace(legs[3], links=(coxa, replace(femur, axis=(0.0, 1.0, 0.0)), tibia))
    with pytest.raises(RobotError, match=r"leg RF, joint 2.*\(0\.0, -1\.0, 0\.0\)"):
        LegSolver(replace(robot, legs=tuple(legs)))


# Tests the transformation of feet from the walking frame to the torso's frame, with their
# velocities.

POSTURE_ROUND_OFF = 1e-14  # m
TIME_STEP = 1e-4  # s, step of central differences: truncation STEP^2 x 5^3 x 0.2 m/6
RATE_ERROR = 1e-7  # m/s
TIMES = (0.1, 0.3, 0.7, 1.1)


def moving_feet(t: float) -> Feet:
    """Returns feet that move on circles in the walking frame, with their velocities."""
    legs = np.arange(6.0)
    plane = 0.2 * np.exp(1j * legs) + 0.03 * np.exp(1j * (3.0 * t + legs))
    height = -0.12 + 0.02 * np.sin(4.0 * t + legs)
    return Feet(plane, height, 0.09j * np.exp(1j * (3.0 * t + legs)), 0.08 * np.cos(4.0 * t + legs))


def posture(t: float) -> Posture:
    """Returns a torso whose height, roll and pitch all change."""
    value = np.array(
        [0.01 * np.sin(2.0 * t), 0.3 * np.sin(3.0 * t + 0.5), 0.2 * np.sin(5.0 * t - 1.0)]
    )
    return Posture.of(
        value,
        np.array([0.02 * np.cos(2.0 * t), 0.9 * np.cos(3.0 * t + 0.5), np.cos(5.0 * t - 1.0)]),
    )


def leaning(roll: float, pitch: float) -> Posture:
    return Posture.of(np.array([0.0, roll, pitch]), np.zeros(3))


@pytest.mark.parametrize(("roll", "pitch"), [(0.3, 0.0), (0.0, -0.4), (0.25, 0.35)])
def test_the_torso_rolls_about_x_first_and_then_pitches_about_y(roll: float, pitch: float) -> None:
    expected = axis_rotation(np.array([0.0, 1.0, 0.0]), pitch) @ axis_rotation(
        np.array([1.0, 0.0, 0.0]), roll
    )
    np.testing.assert_allclose(leaning(roll, pitch).R_KT, expected, atol=POSTURE_ROUND_OFF)


def test_positive_roll_lowers_the_right_side_and_positive_pitch_the_nose() -> None:
    assert leaning(0.1, 0.0).turn(-0.1j, 0.0)[1] < 0.0
    assert leaning(0.0, 0.1).turn(0.1 + 0j, 0.0)[1] < 0.0


@pytest.mark.parametrize("t", TIMES)
def test_feet_are_seen_where_the_torso_puts_them_back_on_the_ground(t: float) -> None:
    feet, torso = moving_feet(t), posture(t)
    seen = torso.feet_to_torso(feet)
    plane, height = torso.turn(seen.plane, seen.height)
    np.testing.assert_allclose(plane, feet.plane, atol=POSTURE_ROUND_OFF)
    np.testing.assert_allclose(height + torso.height, feet.height, atol=POSTURE_ROUND_OFF)
    np.testing.assert_array_equal(
        torso.to_torso(feet.plane, feet.height), (seen.plane, seen.height)
    )


@pytest.mark.parametrize("t", TIMES)
def test_velocities_are_the_slopes_of_positions_while_feet_and_torso_move(t: float) -> None:
    before, now, after = (
        posture(at).feet_to_torso(moving_feet(at)) for at in (t - TIME_STEP, t, t + TIME_STEP)
    )
    np.testing.assert_allclose(
        now.velocity, (after.plane - before.plane) / (2.0 * TIME_STEP), atol=RATE_ERROR
    )
    np.testing.assert_allclose(
        now.rise, (after.height - before.height) / (2.0 * TIME_STEP), atol=RATE_ERROR
    )
