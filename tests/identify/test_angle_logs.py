"""Logs of joint angles alone: the robot starts on its feet, as leaning as these say, and the search
follows a curved valley to its end, so that the contacts' numbers are found.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root
from secret_robots import GROUPS, secret_robot

from hexapod_cosim.extensions.identify.fitting.rank import QUANTILE
from hexapod_cosim.extensions.identify.identify import identify
from hexapod_cosim.extensions.identify.start import standing_attitude
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.kinematics import axis_quaternion, foot_positions, quaternion_product
from hexapod_cosim.models.kinematics import rotation_matrix as rotation

ROLL, PITCH = 0.05, -0.08  # rad
WIDE = 3.0  # deviations, beyond which one of 100 numbers is with a probability of 0.24


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
    assert found == pytest.approx(turn, abs=1e-12)


def test_a_robot_that_leans_more_than_one_can_stand_is_taken_as_level() -> None:
    robot = load_robot("athena")
    angles = leaning(robot, axis_quaternion(np.array([1.0, 0.0, 0.0]), 0.32))
    assert standing_attitude(robot, angles).tolist() == [1.0, 0.0, 0.0, 0.0]


def test_contacts_are_found_from_joint_angles_alone(plant_build: Path, tmp_path: Path) -> None:
    """The sum of squares has a curved valley here: mass and its place act alike. Before, readings
    that a step along it changes otherwise than derivatives say were left out as jumps, and the
    search ended 5 deviations from the restitution.
    """
    groups = tuple(name for name in GROUPS if name in ("mass", "contact"))
    secret = secret_robot(63, tmp_path, duration=4.0, groups=groups)
    log = secret.log.without([name for name in secret.log.measured if not name.endswith(".angle")])
    found = identify([log], load_robot("athena"), groups=groups)
    own = {one.key: one for one in found.estimates}
    for key in ("contact.stiffness", "contact.restitution", "friction.mu", "friction.slope"):
        one = own[key]
        assert one.told, key
        true, half = secret.values[key], 0.5 * (one.high - one.low) * WIDE / QUANTILE
        assert abs(one.value - true) < half, key
