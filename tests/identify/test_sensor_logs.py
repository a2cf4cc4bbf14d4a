"""Numbers of sensors: each kind has its own delay, readings have biases and angles have zeros."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root
from secret_robots import secret_robot

from hexapod_cosim.extensions.identify.fitting.least_squares import ENOUGH
from hexapod_cosim.extensions.identify.identification import identify
from hexapod_cosim.extensions.identify.numbers import QUANTILE
from hexapod_cosim.extensions.identify.results import warnings
from hexapod_cosim.extensions.identify.start import standing_attitude
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.kinematics import axis_quaternion, foot_positions, quaternion_product
from hexapod_cosim.models.kinematics import rotation_matrix as rotation

KINDS = ("joints", "currents", "forces", "imu", "pose")
ROLL, PITCH = 0.05, -0.08  # rad


def test_delays_and_biases_lie_within_their_intervals(plant_build: Path, tmp_path: Path) -> None:
    """35 numbers: 5 delays, drawn between 1 and 9 ms where rows are 5 ms apart, and biases of 6
    columns of the IMU, 18 of torques, 6 of forces. Of 35, at most 5 are outside with a probability
    of 0.99.
    """
    secret = secret_robot(4, tmp_path, duration=1.8, groups=("sensor",))
    found = identify([secret.log], load_robot("athena"), groups=("sensor",))
    delays = [secret.values[f"delay.{kind}"] for kind in KINDS]
    assert max(delays) - min(delays) > 0.003
    own = {one.key: one.value for one in found.estimates}
    for kind, delay in zip(KINDS[:4], delays, strict=False):
        assert own[f"delay.{kind}"] == pytest.approx(delay, abs=2e-4), kind
    assert own["delay.pose"] == pytest.approx(delays[4], abs=2e-3)  # it moves slowly
    determined = [one for one in found.estimates if one.determined]
    assert len(determined) == 35
    outside = [one for one in determined if not one.low <= secret.values[one.key] <= one.high]
    assert len(outside) <= 5
    assert warnings(found) == []


def test_zeros_of_the_angles_lie_within_their_intervals(plant_build: Path, tmp_path: Path) -> None:
    """Of 18, at most 3 are outside with a probability of 0.99. The mean square is 1 +- 0.33."""
    secret = secret_robot(6, tmp_path, duration=3.0, groups=("zero",))
    found = identify([secret.log], load_robot("athena"), groups=("zero",))
    determined = [one for one in found.estimates if one.determined]
    assert len(determined) == 18
    outside = [one for one in determined if not one.low <= secret.values[one.key] <= one.high]
    assert len(outside) <= 3
    off = [
        2.0 * QUANTILE * (one.value - secret.values[one.key]) / (one.high - one.low)
        for one in determined
    ]
    assert 0.2 < float(np.mean(np.square(off))) < 2.0
    assert found.fit.decrement < 2.0 * ENOUGH
    assert warnings(found) == []


def leaning(robot: Robot, turn: np.ndarray) -> np.ndarray:
    """Returns angles (6, 3) with which a torso of an attitude has its feet on level ground."""
    stance = np.array([leg.stance for leg in robot.legs])
    level, down = foot_positions(robot, stance), rotation(turn)

    def off(angles: np.ndarray) -> np.ndarray:
        return np.asarray((foot_positions(robot, angles.reshape(6, 3)) @ down.T - level).ravel())

    found = root(off, stance.ravel(), tol=1e-13)
    assert np.abs(off(found.x)).max() < 1e-12
    return np.asarray(found.x.reshape(6, 3))


def test_the_attitude_of_a_standing_robot_is_that_of_its_feet() -> None:
    robot = load_robot("athena")
    turn = quaternion_product(
        axis_quaternion(np.array([0.0, 1.0, 0.0]), PITCH),
        axis_quaternion(np.array([1.0, 0.0, 0.0]), ROLL),
    )
    found = standing_attitude(robot, leaning(robot, turn))
    assert found == pytest.approx((ROLL, PITCH), abs=1e-12)
