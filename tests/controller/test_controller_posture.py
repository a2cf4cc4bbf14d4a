"""Tests the transformation of feet from the walking frame to the torso's frame, with their
velocities.
"""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.controller.comply.posture import Posture
from hexapod_cosim.controller.walk.kinematics import Feet
from hexapod_cosim.models.kinematics import axis_rotation

ROUND_OFF = 1e-14  # m
STEP = 1e-4  # s, step of central differences: truncation STEP^2 x 5^3 x 0.2 m/6
DIFFERENCE_ERROR = 1e-7  # m/s
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
    np.testing.assert_allclose(leaning(roll, pitch).rotation, expected, atol=ROUND_OFF)


def test_positive_roll_lowers_the_right_side_and_positive_pitch_the_nose() -> None:
    assert leaning(0.1, 0.0).turn(-0.1j, 0.0)[1] < 0.0
    assert leaning(0.0, 0.1).turn(0.1 + 0j, 0.0)[1] < 0.0


@pytest.mark.parametrize("t", TIMES)
def test_feet_are_seen_where_the_torso_puts_them_back_on_the_ground(t: float) -> None:
    feet, torso = moving_feet(t), posture(t)
    seen = torso.see(feet)
    plane, height = torso.turn(seen.plane, seen.height)
    np.testing.assert_allclose(plane, feet.plane, atol=ROUND_OFF)
    np.testing.assert_allclose(height + torso.height, feet.height, atol=ROUND_OFF)
    np.testing.assert_array_equal(
        torso.see_place(feet.plane, feet.height), (seen.plane, seen.height)
    )


@pytest.mark.parametrize("t", TIMES)
def test_velocities_are_the_slopes_of_positions_while_feet_and_torso_move(t: float) -> None:
    before, now, after = (posture(at).see(moving_feet(at)) for at in (t - STEP, t, t + STEP))
    np.testing.assert_allclose(
        now.velocity, (after.plane - before.plane) / (2.0 * STEP), atol=DIFFERENCE_ERROR
    )
    np.testing.assert_allclose(
        now.rise, (after.height - before.height) / (2.0 * STEP), atol=DIFFERENCE_ERROR
    )
