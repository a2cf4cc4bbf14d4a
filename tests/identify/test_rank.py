"""What readings do not tell: numbers with a share in a combination that nothing shows are not told,
errors of derivatives are no information, and the combination that is told has a name.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from secret_robots import secret_robot

from hexapod_cosim.extensions.identify.fitting.rank import (
    Combination,
    combination_text,
    combinations,
    sharpened,
    told,
    untold,
    weak_moves,
)
from hexapod_cosim.extensions.identify.identify import identify
from hexapod_cosim.extensions.identify.identify_tables import untold_text
from hexapod_cosim.extensions.identify.robot_file import write_robot
from hexapod_cosim.extensions.identify.unknowns import ROBOT
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.servos.motor import back_emf_damping
from hexapod_cosim.models.servos.presets import measured_servo

Array = NDArray[np.float64]
MOTOR = ("servo.torque_constant", "servo.resistance")
ROWS = [next(row for row in ROBOT if row.key == key) for key in (*MOTOR, "servo.kp")]
BOTH = np.ones(3, dtype=np.bool_)


def of_product(information: float) -> Array:
    """Returns the information (3, 3) of readings that tell 2 z1 - z2 and z3."""
    direction = np.array([2.0, -1.0, 0.0]) / np.sqrt(5.0)
    found = information * np.outer(direction, direction)
    found[2, 2] = information
    return found


def test_a_number_is_not_told_by_what_was_known_of_its_partner() -> None:
    """The torque constant has a deviation of 0.447 priors, but only k_t^2/R is told."""
    information = of_product(1e6)
    deviation = np.sqrt(np.diag(np.linalg.inv(information + np.eye(3))))
    assert deviation[0] == pytest.approx(np.sqrt(0.2), rel=1e-3)
    assert told(information).tolist() == [False, False, True]


def test_one_number_stays_and_the_other_carries_the_combination() -> None:
    information = of_product(1e6)
    stay = untold(information, BOTH)
    assert stay.tolist() == [False, True, False]
    (one,) = combinations(information, stay, BOTH, ROWS)
    assert (one.key, one.others) == (MOTOR[0], MOTOR[1:])
    assert one.slopes == pytest.approx((0.5,), rel=1e-3)
    values = {MOTOR[0]: 1.5, MOTOR[1]: 2.0}
    text = combination_text(replace(one, deviation=0.05), ROWS, values)
    # 1.125 times exp(-+ 2 * 1.96 * 0.05 * 0.2)
    assert text == "servo.torque_constant^2 / servo.resistance = 1.125 (1.0818 to 1.17)"


def test_a_sum_has_factors() -> None:
    """A centre of mass on a linear scale (prior 0.01 m) with a mass of 0.2 kg known to 20 %."""
    rows = [
        next(row for row in ROBOT if row.key == f"links.femur.{key}") for key in ("com[1]", "mass")
    ]
    one = Combination("links.femur.com[1]", ("links.femur.mass",), (-2.0,), 0.1)
    text = combination_text(one, rows, {"links.femur.com[1]": 0.06, "links.femur.mass": 0.2})
    assert text == "links.femur.com[1] +0.5 links.femur.mass = 0.16 (0.15804 to 0.16196)"


def test_what_readings_tell_well_stays_told() -> None:
    information = np.diag([1e4, 100.0, 5.0])
    assert told(information).tolist() == [True, True, True]
    assert not untold(information, BOTH).any()
    assert told(np.diag([1e4, 100.0, 2.9])).tolist() == [True, True, False]


class Noisy:
    """Stands for a problem of three numbers whose readings show 2 z1 - z2 and z3, with derivatives
    that have errors of 0.01 deviations.
    """

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        self.matrix = np.zeros((10_000, 3))
        shown = rng.normal(size=10_000)
        self.matrix[:, :2] = np.outer(shown, [2.0, -1.0])
        self.matrix[:, 2] = rng.normal(size=10_000)
        self.slopes = self.matrix + 0.01 * rng.normal(size=self.matrix.shape)

    def bounds(self) -> tuple[Array, Array]:
        return np.full(3, -8.0), np.full(3, 8.0)

    def residuals(self, z: Array) -> Array:
        return np.concatenate([self.matrix @ z, z])


def test_errors_of_derivatives_are_no_information() -> None:
    problem: Any = Noisy()
    false = problem.slopes.T @ problem.slopes
    jacobian = np.vstack([problem.slopes, np.eye(3)])
    found = sharpened(jacobian, weak_moves(problem, np.zeros(3), false, 100.0))[:-3]
    assert np.linalg.eigvalsh(false)[0] == pytest.approx(1.0, rel=0.1)  # 10^4 errors of 0.01
    assert np.linalg.eigvalsh(found.T @ found)[0] < 1e-3
    expected = np.linalg.eigvalsh(false)[1:]
    assert np.linalg.eigvalsh(found.T @ found)[1:] == pytest.approx(expected, rel=1e-3)


class Steep:
    """Stands for a problem of a number of which 1600 readings tell 40, and of which 100 others have
    a slope of 1.3 between -0.01 and 0.01 priors alone, as near a foot that barely lifts.
    """

    RANGE = 0.01  # priors

    def bounds(self) -> tuple[Array, Array]:
        return np.full(1, -8.0), np.full(1, 8.0)

    def residuals(self, z: Array) -> Array:
        near = np.clip(z[0], -self.RANGE, self.RANGE)
        return np.concatenate([np.full(1600, np.sqrt(0.025) * z[0]), np.full(100, 1.3 * near), z])


def test_slopes_that_end_within_the_deviation_are_no_information() -> None:
    """Such slopes made intervals of masses three times too narrow, and one in ten numbers of a
    robot lay outside.
    """
    problem: Any = Steep()
    z = np.zeros(1)
    step = 0.5 * Steep.RANGE
    jacobian = (problem.residuals(z + step) - problem.residuals(z - step))[:, None] / (2.0 * step)
    steep = float(jacobian[:-1, 0] @ jacobian[:-1, 0])
    assert steep == pytest.approx(40.0 + 100.0 * 1.3**2)
    for _ in range(2):
        slopes = jacobian[:-1]
        jacobian = sharpened(jacobian, weak_moves(problem, z, slopes.T @ slopes, 1000.0))
    found = float(jacobian[:-1, 0] @ jacobian[:-1, 0])
    assert 40.0 <= found < 45.0


def test_a_log_without_currents_tells_the_damping_of_the_motor_alone(
    plant_build: Path, tmp_path: Path
) -> None:
    """The back-EMF's k_t^2/R; the torque constant and the resistance need currents. Before, both
    were told with intervals that missed them.
    """
    file = replace(load_robot("athena"), servo=measured_servo("mx64_m6").servo)
    secret = secret_robot(61, tmp_path, duration=2.5, groups=("servo",), file=file)
    found = identify([secret.log], file, groups=("servo",))
    own = {one.key: one for one in found.estimates}
    assert [own[key].told for key in MOTOR] == [False, False]
    stays = next(key for key in MOTOR if not own[key].combination)
    assert own[stays].value == own[stays].before
    carries = own[next(key for key in MOTOR if own[key].combination)]
    assert carries.combination.startswith("servo.torque_constant^2 / servo.resistance = ")
    damping, low, high = (
        float(text.strip("()"))
        for text in carries.combination.partition("= ")[2].split()
        if text != "to"
    )
    assert damping == pytest.approx(back_emf_damping(found.robot.servo), rel=1e-4)
    assert low < back_emf_damping(secret.robot.servo) < high
    assert high < 1.1 * low
    text = untold_text(found)
    assert carries.combination in text
    assert "Currents would tell both" in text
    document = tmp_path / "robot.toml"
    write_robot(replace(found, file=load_robot("athena")), "athena", document, ["log.csv"])
    source = tomllib.loads(document.read_text(encoding="utf-8"))["source"]
    assert source[stays] == "not told by log.csv: as before"
    assert source[carries.key].startswith(
        f"not told alone by log.csv: it tells {carries.combination}"
    )
