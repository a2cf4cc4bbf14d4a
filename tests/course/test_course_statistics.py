"""Intervals of the course against closed forms and against chance."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hexapod_cosim.extensions.course.statistics import Rate, median_ratio, wilson


def test_wilsons_interval_solves_its_equation() -> None:
    z = 1.959963984540054  # normal quantile of 97.5 %
    for successes, runs in ((3, 10), (1, 4), (57, 60), (5, 10)):
        found = wilson(successes, runs)
        share = successes / runs
        assert found.value == share
        for end in (found.low, found.high):
            assert (end - share) ** 2 == pytest.approx(z**2 * end * (1.0 - end) / runs, rel=1e-12)
        assert found.low < share < found.high


def test_no_and_all_successes_have_one_sided_intervals() -> None:
    z = 1.959963984540054
    none, every = wilson(0, 10), wilson(10, 10)
    assert (none.value, none.low) == (0.0, 0.0)
    assert none.high == pytest.approx(z**2 / (10 + z**2))
    assert (every.value, every.high) == (1.0, 1.0)
    assert every.low == pytest.approx(1.0 - none.high)


def test_a_rate_of_no_runs_is_unknown() -> None:
    assert math.isnan(Rate(0, 0).interval.value)


def test_the_median_of_ratios_is_that_of_the_means() -> None:
    samples = [
        np.array([[1.0, 2.0], [3.0, 6.0]]),  # 2
        np.array([[1.0, 1.0], [3.0, 1.0]]),  # 1/2
        np.array([[2.0, 2.0], [2.0, 4.0]]),  # 3/2
    ]
    assert median_ratio(samples).value == 1.5


def test_pairs_in_one_ratio_leave_no_uncertainty() -> None:
    before = np.array([1.0, 2.0, 5.0])
    found = median_ratio([np.column_stack([before, 0.25 * before])] * 3)
    assert (found.value, found.low, found.high) == (0.25, 0.25, 0.25)


def test_equal_samples_give_equal_intervals() -> None:
    generator = np.random.default_rng(3)
    samples = [generator.uniform(1.0, 2.0, (10, 2)) for _ in range(5)]
    assert median_ratio(samples) == median_ratio([sample.copy() for sample in samples])


def test_one_pair_gives_no_interval_and_no_case_no_value() -> None:
    found = median_ratio([np.array([[2.0, 1.0]])])
    assert found.value == 0.5
    assert math.isnan(found.low)
    assert math.isnan(median_ratio([]).value)


def test_the_interval_covers_the_truth_about_as_often_as_it_says() -> None:
    # 10 seeds of one case, ratio 0.5, 20 % spread; a percentile bootstrap of 10 is a little narrow
    generator = np.random.default_rng(0)
    hits = 0
    for _ in range(200):
        before = generator.normal(1.0, 0.2, 10)
        after = 0.5 * generator.normal(1.0, 0.2, 10)
        found = median_ratio([np.column_stack([before, after])])
        hits += found.low <= 0.5 <= found.high
    assert 0.85 <= hits / 200 <= 0.99
