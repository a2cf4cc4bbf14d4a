"""The mathematics of the fit: least squares, intervals with the coverage that they claim, numbers
that readings do not determine, and readings that jump.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from hexapod_cosim.extensions.identify.fitting.covariance import (
    Series,
    coloured_information,
    spectrum,
    white_information,
)
from hexapod_cosim.extensions.identify.fitting.least_squares import (
    differences,
    minimised,
    remaining_step,
)
from hexapod_cosim.extensions.identify.fitting.misfit import determined, sharpened, to_keep
from hexapod_cosim.extensions.identify.identification import Estimate
from hexapod_cosim.extensions.identify.numbers import QUANTILE

Array = NDArray[np.float64]
ROWS, COLUMNS, RUNS = 240, 6, 200
# of 200 runs: three standard deviations of a share of 0.95
WITHIN = 3.0 * np.sqrt(0.95 * 0.05 / RUNS)
FREE = np.full(4, -8.0), np.full(4, 8.0)
ALL_THREE = np.ones(3, dtype=np.bool_)


def test_a_robust_fit_passes_outliers_and_leaves_no_step() -> None:
    rng = np.random.default_rng(1)
    jacobian, true = rng.normal(size=(200, 4)), np.array([0.5, -1.0, 2.0, 0.1])
    readings = jacobian @ true
    readings[::20] += 50.0
    found = minimised(
        lambda z: jacobian @ z - readings,
        np.zeros(4),
        jacobian=lambda _z: jacobian,
        bounds=FREE,
        enough=1e-12,
    )
    assert found == pytest.approx(true, abs=0.3)  # the ten outliers pull with 3 deviations each
    step = remaining_step(jacobian, jacobian @ found - readings, found, FREE)
    assert step == pytest.approx(np.zeros(4), abs=1e-4)


def test_the_remaining_step_leads_to_the_optimum_within_the_limits() -> None:
    """Of two correlated numbers the free one takes the step that it takes alone."""
    jacobian = np.array([[1.0, 0.5], [0.5, 1.0], [0.0, 0.0]])
    residuals = jacobian @ np.array([1.0, -0.25])  # the optimum is at (-1, 0.25) from z
    z, wide = np.array([0.0, 1.0]), (np.full(2, -8.0), np.full(2, 8.0))
    assert remaining_step(jacobian, residuals, z, wide) == pytest.approx([-1.0, 0.25], abs=1e-12)
    limits = np.zeros(2), np.full(2, 8.0)
    assert remaining_step(jacobian, residuals, z, limits) == pytest.approx([0.0, -0.55], abs=1e-12)


def coloured(rng: np.random.Generator, slow: float) -> Array:
    """Returns noise (rows, columns) of variance 1 of an autoregression of first order."""
    white = rng.standard_normal((ROWS + 100, COLUMNS))
    found = lfilter([np.sqrt(1.0 - slow**2)], [1.0, -slow], white, axis=0)
    return np.asarray(found[100:])


def coverage(slow: float, *, white: bool) -> Array:
    """Returns the share of runs (3,) in which each number lies within its 95 % interval: a zero, a
    gain of slow and one of fast motion.
    """
    rng = np.random.default_rng(3)
    time = np.arange(ROWS)[:, None] + 7.0 * np.arange(COLUMNS)
    fast = np.sin(1.3 * time) + 0.1 * rng.standard_normal((ROWS, COLUMNS))
    jacobian = np.stack([np.ones((ROWS, COLUMNS)), np.sin(0.05 * time), fast], axis=-1)
    inside = np.zeros(3)
    for _ in range(RUNS):
        noise = coloured(rng, slow)
        found = np.linalg.lstsq(jacobian.reshape(-1, 3), noise.ravel(), rcond=None)[0]
        series = [Series(noise - jacobian @ found, jacobian, 1.0)]
        information = white_information(series) if white else coloured_information(series)
        inside += np.abs(found) < QUANTILE * np.sqrt(np.diag(np.linalg.inv(information)))
    return np.asarray(inside / RUNS)


@pytest.mark.parametrize("slow", [0.0, 0.9])
def test_intervals_of_a_linear_problem_cover_in_95_of_100_cases(slow: float) -> None:
    assert coverage(slow, white=False) == pytest.approx(np.full(3, 0.95), abs=WITHIN)


def test_intervals_for_white_residuals_miss_where_these_are_slow() -> None:
    """An autoregression of 0.9 has 19 times the power of white noise at frequency 0."""
    zero, slow, fast = coverage(0.9, white=True)
    assert zero < 0.5
    assert slow < 0.6
    assert fast > 0.99


def test_the_spectrum_of_an_autoregression_is_its_closed_form() -> None:
    """S = (1 - a^2) / (1 - 2 a cos w + a^2) at frequency w [rad/row]."""
    rng, jacobian = np.random.default_rng(5), np.zeros((ROWS, COLUMNS, 1))
    series = [Series(coloured(rng, 0.5), jacobian, 1.0) for _ in range(50)]
    found = np.mean([spectrum(one, np.eye(1)) for one in series], axis=0)
    expected = 0.75 / (1.25 - np.cos(np.linspace(0.0, np.pi, len(found))))
    assert found == pytest.approx(expected, rel=0.1)


def of_product(information: float) -> Array:
    """Returns the information (3, 3) of readings that determine 2 z1 - z2 and z3."""
    direction = np.array([2.0, -1.0, 0.0]) / np.sqrt(5.0)
    found = information * np.outer(direction, direction)
    found[2, 2] = information
    return found


def test_a_number_is_not_determined_by_what_was_known_of_its_partner() -> None:
    """The torque constant has a deviation of 0.447 priors, but only k_t^2/R is determined."""
    information = of_product(1e6)
    deviation = np.sqrt(np.diag(np.linalg.inv(information + np.eye(3))))
    assert deviation[0] == pytest.approx(np.sqrt(0.2), rel=1e-3)
    assert determined(information).tolist() == [False, False, True]
    kept = to_keep(information, ALL_THREE)
    assert kept.tolist() == [False, True, False]


def test_what_readings_determine_well_stays_so() -> None:
    information = np.diag([1e4, 100.0, 5.0])
    assert determined(information).all()
    assert not to_keep(information, ALL_THREE).any()
    assert determined(np.diag([1e4, 100.0, 2.9])).tolist() == [True, True, False]


class Noisy:
    """Stands for a problem of three numbers whose readings show 2 z1 - z2 and z3, with derivatives
    that have errors of 0.01 deviations.
    """

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        self.matrix = np.zeros((10_000, 3))
        self.matrix[:, :2] = np.outer(rng.normal(size=10_000), [2.0, -1.0])
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
    found = sharpened(problem, np.zeros(3), jacobian, false)[:-3]
    assert np.linalg.eigvalsh(false)[0] == pytest.approx(1.0, rel=0.1)  # 10^4 errors of 0.01
    assert np.linalg.eigvalsh(found.T @ found)[0] < 1e-3
    expected = np.linalg.eigvalsh(false)[1:]
    assert np.linalg.eigvalsh(found.T @ found)[1:] == pytest.approx(expected, rel=1e-3)


def test_a_difference_over_a_jump_is_bent_and_one_of_a_curve_is_not() -> None:
    """Readings z, z^2 and z + (z > 0.005) at z = 0, moved by 0.01 to both sides. The slope of the
    second is that of one side, 0.01 off; that of the third is the one without the jump.
    """
    forth = np.array([0.01, 1e-4, 1.01])
    back = np.array([-0.01, 1e-4, -0.01])
    slope, bend = differences([(0.01, forth), (-0.01, back)], 3)
    assert bend == pytest.approx([0.0, 2e-4, 1.0], abs=1e-12)
    assert slope == pytest.approx([1.0, -0.01, 1.0], abs=1e-12)


def test_an_interval_is_written_with_the_digits_in_which_its_ends_differ() -> None:
    one = Estimate("servo.kp", "N m/rad", "servo", 50.0, 40.0, 39.999998, 40.000002, 1e-8)
    assert (one.interval, one.found) == ("39.999998 to 40.000002", "40")
    wide = Estimate("torso.mass", "kg", "mass", 2.6, 2.9, 2.85072, 3.28554, 0.1)
    assert wide.interval == "2.8507 to 3.2855"
