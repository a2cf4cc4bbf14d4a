"""The torso over its feet: from the walking frame to the torso's, and the velocities that go
with it.
"""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.controller.kinematics import Feet
from hexapod_cosim.controller.posture import in_torso_frame, rotations, turned
from hexapod_cosim.models.kinematics import axis_rotation

ROUND_OFF = 1e-14  # m
STEP = 1e-4  # s    of central differences: truncation STEP^2 x 5^3 x 0.2 m / 6
DIFFERENCE_ERROR = 1e-7  # m/s
TIMES = np.array([0.1, 0.3, 0.7, 1.1])


def moving_feet(t: np.ndarray) -> Feet:
    """(n, 6) feet that go round in the walking frame, with their velocities."""
    legs, t = np.arange(6.0), t[:, None]
    plane = 0.2 * np.exp(1j * legs) + 0.03 * np.exp(1j * (3.0 * t + legs))
    height = -0.12 + 0.02 * np.sin(4.0 * t + legs)
    return Feet(plane, height, 0.09j * np.exp(1j * (3.0 * t + legs)), 0.08 * np.cos(4.0 * t + legs))


def posture(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) height, roll and pitch, and their rates."""
    value = np.column_stack(
        [0.01 * np.sin(2.0 * t), 0.3 * np.sin(3.0 * t + 0.5), 0.2 * np.sin(5.0 * t - 1.0)]
    )
    return value, np.column_stack(
        [0.02 * np.cos(2.0 * t), 0.9 * np.cos(3.0 * t + 0.5), np.cos(5.0 * t - 1.0)]
    )


@pytest.mark.parametrize(("roll", "pitch"), [(0.3, 0.0), (0.0, -0.4), (0.25, 0.35)])
def test_the_torso_rolls_about_x_first_and_then_pitches_about_y(roll: float, pitch: float) -> None:
    expected = axis_rotation(np.array([0.0, 1.0, 0.0]), pitch) @ axis_rotation(
        np.array([1.0, 0.0, 0.0]), roll
    )
    np.testing.assert_allclose(
        rotations(np.array([roll]), np.array([pitch]))[0], expected, atol=ROUND_OFF
    )


def test_positive_roll_lowers_the_right_side_and_positive_pitch_the_nose() -> None:
    right, nose = np.array([[-0.1j]]), np.array([[0.1 + 0j]])
    level = np.zeros((1, 1))
    assert turned(right, level, rotations(np.array([0.1]), np.zeros(1)))[1][0, 0] < 0.0
    assert turned(nose, level, rotations(np.zeros(1), np.array([0.1])))[1][0, 0] < 0.0


def test_feet_are_seen_where_the_torso_puts_them_back_on_the_ground() -> None:
    feet, (value, rate) = moving_feet(TIMES), posture(TIMES)
    seen = in_torso_frame(feet, value, rate)
    plane, height = turned(seen.plane, seen.height, rotations(value[:, 1], value[:, 2]))
    np.testing.assert_allclose(plane, feet.plane, atol=ROUND_OFF)
    np.testing.assert_allclose(height + value[:, :1], feet.height, atol=ROUND_OFF)


def test_velocities_are_the_slopes_of_positions_while_feet_and_torso_move() -> None:
    before, now, after = (
        in_torso_frame(moving_feet(t), *posture(t)) for t in (TIMES - STEP, TIMES, TIMES + STEP)
    )
    np.testing.assert_allclose(
        now.velocity, (after.plane - before.plane) / (2.0 * STEP), atol=DIFFERENCE_ERROR
    )
    np.testing.assert_allclose(
        now.rise, (after.height - before.height) / (2.0 * STEP), atol=DIFFERENCE_ERROR
    )


def test_one_step_is_turned_as_many_are() -> None:
    feet, rotation = moving_feet(TIMES), rotations(*posture(TIMES)[0].T[1:])
    plane, height = turned(feet.plane, feet.height, rotation)
    one, z = turned(feet.plane[2], feet.height[2], rotation[2])
    np.testing.assert_allclose(one, plane[2], atol=ROUND_OFF)
    np.testing.assert_allclose(z, height[2], atol=ROUND_OFF)
