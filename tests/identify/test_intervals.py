"""Intervals of fitted numbers have the coverage that they claim, for white and coloured residuals,
and the search ends at the optimum.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from secret_robots import Secret, secret_robot

from hexapod_cosim.extensions.identify.fitting.covariance import (
    Series,
    coloured_information,
    readings_as_one,
    spectrum,
    white_information,
)
from hexapod_cosim.extensions.identify.fitting.last_search import ENOUGH, bounded_step
from hexapod_cosim.extensions.identify.identified import Estimate, Identified
from hexapod_cosim.extensions.identify.identify import identify
from hexapod_cosim.extensions.identify.identify_tables import warnings
from hexapod_cosim.models import load_robot

Array = NDArray[np.float64]
ROWS, COLUMNS, RUNS = 240, 6, 200
# of 200 runs: three standard deviations of a share of 0.95
WITHIN = 3.0 * np.sqrt(0.95 * 0.05 / RUNS)


def coloured(rng: np.random.Generator, slow: float) -> Array:
    """Returns noise (rows, columns) of variance 1 of an autoregression of first order."""
    white = rng.standard_normal((ROWS + 100, COLUMNS))
    found = lfilter([np.sqrt(1.0 - slow**2)], [1.0, -slow], white, axis=0)
    return np.asarray(found[100:])


def slopes(rng: np.random.Generator) -> Array:
    """Returns derivatives (rows, columns, 3) by a zero, a gain of slow and one of fast motion."""
    time = np.arange(ROWS)[:, None] + 7.0 * np.arange(COLUMNS)
    fast = np.sin(1.3 * time) + 0.1 * rng.standard_normal((ROWS, COLUMNS))
    return np.stack([np.ones((ROWS, COLUMNS)), np.sin(0.05 * time), fast], axis=-1)


def coverage(slow: float, *, white: bool) -> Array:
    """Returns the share of runs (3,) in which each number lies within its 95 % interval."""
    rng = np.random.default_rng(3)
    jacobian = slopes(rng)
    flat = jacobian.reshape(-1, 3)
    inside = np.zeros(3)
    for _ in range(RUNS):
        noise = coloured(rng, slow)
        found = np.linalg.lstsq(flat, noise.ravel(), rcond=None)[0]
        left = noise - jacobian @ found
        series = [Series("angle", left, jacobian, 1.0)]
        information = white_information(series) if white else coloured_information(series)
        deviation = np.sqrt(np.diag(np.linalg.inv(information)))
        inside += np.abs(found) < 1.959963985 * deviation
    return np.asarray(inside / RUNS)


@pytest.mark.parametrize("slow", [0.0, 0.5, 0.9])
def test_intervals_of_a_linear_problem_cover_in_95_of_100_cases(slow: float) -> None:
    assert coverage(slow, white=False) == pytest.approx(np.full(3, 0.95), abs=WITHIN)


def test_intervals_for_white_residuals_miss_where_these_are_slow() -> None:
    """An autoregression of 0.9 has 19 times the power of white noise at frequency 0."""
    zero, slow, fast = coverage(0.9, white=True)
    assert zero < 0.5
    assert slow < 0.6
    assert fast > 0.99


def test_the_spectrum_of_an_autoregression_is_its_closed_form() -> None:
    """S = (1 - a^2) / (1 - 2 a cos w + a^2) at frequency w [rad/row], 3 at 0 where a = 0.5."""
    rng, jacobian = np.random.default_rng(5), np.zeros((ROWS, COLUMNS, 1))
    found = np.mean(
        [
            spectrum(Series("angle", coloured(rng, 0.5), jacobian, 1.0), np.eye(1))
            for _ in range(50)
        ],
        axis=0,
    )
    frequency = np.linspace(0.0, np.pi, len(found))
    expected = 0.75 / (1.25 - np.cos(frequency))
    assert found == pytest.approx(expected, rel=0.1)
    series = [Series("angle", coloured(rng, 0.5), jacobian, 1.0)]
    assert readings_as_one(series, np.eye(1))["angle"] == pytest.approx(3.0, rel=0.4)


class Bounded:
    """Stands for a problem of two numbers from 0 on."""

    rows = (0, 1)

    def bounds(self) -> tuple[Array, Array]:
        return np.zeros(2), np.full(2, 8.0)


def test_the_remaining_step_does_not_leave_the_limits() -> None:
    """Of two correlated numbers the free one takes the step that it takes alone."""
    problem: Any = Bounded()
    jacobian = np.array([[1.0, 0.5], [0.5, 1.0], [0.0, 0.0]])
    residuals = jacobian @ np.array([1.0, -0.25])  # the optimum is at (-1, 0.25)
    step = bounded_step(problem, np.array([0.0, 1.0]), jacobian, residuals)
    assert step == pytest.approx([0.0, -0.55], abs=1e-12)


@pytest.fixture(scope="module")
def zeros(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Secret, Identified]:
    secret = secret_robot(6, tmp_path_factory.mktemp("zeros"), duration=3.0, groups=("zero",))
    return secret, identify([secret.log], load_robot("athena"), groups=("zero",))


def test_zeros_of_the_angles_lie_within_their_intervals(zeros: tuple[Secret, Identified]) -> None:
    """Of 18, at most 3 are outside with a probability of 0.99. The mean square is 1 +- 0.33."""
    secret, found = zeros
    told = [one for one in found.estimates if one.told]
    assert len(told) == 18
    assert sum(not one.low <= secret.values[one.key] <= one.high for one in told) <= 3
    off = [(one.value - secret.values[one.key]) / (one.high - one.low) * 3.92 for one in told]
    assert 0.2 < float(np.mean(np.square(off))) < 2.0


def test_the_search_ends_a_tenth_of_a_deviation_from_the_optimum(
    zeros: tuple[Secret, Identified],
) -> None:
    assert zeros[1].fit.decrement < 2.0 * ENOUGH
    assert warnings(zeros[1]) == []
    stopped = replace(zeros[1], fit=replace(zeros[1].fit, decrement=3.0))
    assert "ended 3.0 deviations before the optimum" in warnings(stopped)[0]


def test_an_interval_is_printed_with_the_digits_in_which_its_ends_differ() -> None:
    one = Estimate("servo.kp", "N m/rad", "servo", 50.0, 40.0, 39.999998, 40.000002, 1e-8, "", 0.0)
    assert one.interval == "39.999998 to 40.000002"
    assert one.found == "40"
    wide = Estimate("torso.mass", "kg", "mass", 2.6, 2.9, 2.85072, 3.28554, 0.1, "", 0.0)
    assert wide.interval == "2.8507 to 3.2855"
