"""Comparisons of runs: statistics against scipy's, verdicts, runs that fell, and seeds.csv."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from hexapod_cosim.cosim.master.loop import COMPLETED, FAILED
from hexapod_cosim.cosim.report.tables import about, comparison_rows
from hexapod_cosim.cosim.results.comparison import (
    BETTER,
    SAME,
    WORSE,
    Change,
    change_of,
    compare_runs,
)
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.side_by_side import (
    Comparisons,
    compare_all,
    read_seeds,
    write_seeds,
)
from hexapod_cosim.cosim.results.summary import NO_FIGURES, REFUSED, Summary
from hexapod_cosim.models import HexapodError

ROUNDING = 1e-12


def pairs(n: int, *, change: float, noise: float, seed: int = 0) -> list[tuple[float, float]]:
    """Returns values around 1 that differ by `change` and noise within a pair.

    Between pairs they differ by much more.
    """
    generator = np.random.default_rng(seed)
    before = 1.0 + 0.3 * generator.standard_normal(n)
    return list(
        zip(
            before.tolist(),
            (before + change + noise * generator.standard_normal(n)).tolist(),
            strict=True,
        )
    )


def runs(control: str, values: Sequence[float], name: str = "slip_per_metre") -> list[Summary]:
    """Returns a completed walk for each value of one metric; all other metrics are 1."""
    plain = dict.fromkeys(METRICS, 1.0)
    return [
        Summary(
            control=control,
            seed=seed,
            status=COMPLETED,
            upright=True,
            metrics=plain | {name: value},
        )
        for seed, value in enumerate(values)
    ]


@pytest.mark.parametrize("n", [2, 3, 10, 40])
def test_the_interval_of_the_difference_is_students_for_pairs(n: int) -> None:
    values = pairs(n, change=-0.2, noise=0.05)
    before, after = zip(*values, strict=True)
    expected = stats.ttest_rel(after, before).confidence_interval(0.95)
    change = change_of("slip_per_metre", values)
    assert change.difference == pytest.approx(np.mean(after) - np.mean(before), rel=ROUNDING)
    assert change.difference - change.half_width == pytest.approx(expected.low, rel=1e-9)
    assert change.difference + change.half_width == pytest.approx(expected.high, rel=1e-9)
    assert change.relative == pytest.approx(np.mean(after) / np.mean(before) - 1.0, rel=1e-9)


@pytest.mark.parametrize("n", [2, 3, 10, 40])
def test_the_relative_interval_is_that_of_the_ratio_by_its_logarithm(n: int) -> None:
    """The reference is the first-order variance of ln(mean b / mean a) with numpy's covariance."""
    values = np.array(pairs(n, change=-0.2, noise=0.05))
    (a, b), covariance = values.mean(axis=0), np.cov(values.T)
    width = stats.t.ppf(0.975, n - 1) * math.sqrt(
        (covariance[0, 0] / a**2 + covariance[1, 1] / b**2 - 2.0 * covariance[0, 1] / (a * b)) / n
    )
    low, high = change_of(
        "slip_per_metre", [(float(first), float(second)) for first, second in values]
    ).interval
    assert (1.0 + low) == pytest.approx(b / a * math.exp(-width), rel=1e-9)
    assert (1.0 + high) == pytest.approx(b / a * math.exp(width), rel=1e-9)


@pytest.mark.parametrize(("ratio", "scatter"), [(0.5, 0.1), (0.05, 0.3), (2.0, 0.3)])
def test_the_relative_interval_holds_the_true_ratio_in_95_of_100_cases(
    ratio: float, scatter: float
) -> None:
    generator = np.random.default_rng(0)
    held = 0
    for _ in range(1000):
        before = np.exp(0.5 * generator.standard_normal(20))
        after = ratio * before * (1.0 + scatter * generator.uniform(-1.0, 1.0, 20))
        low, high = change_of(
            "slip_per_metre", list(zip(before.tolist(), after.tolist(), strict=True))
        ).interval
        held += low <= ratio - 1.0 <= high
    # of 1000 cases: three standard errors, and first order's own error
    assert held / 1000 == pytest.approx(0.95, abs=0.025)


@pytest.mark.parametrize("seed", range(20))
def test_no_relative_interval_is_below_minus_a_hundred_per_cent(seed: int) -> None:
    """The first values scatter so much that the interval of the difference over their mean would
    be below.
    """
    generator = np.random.default_rng(seed)
    before = np.exp(2.0 * generator.standard_normal(6))
    after = 0.01 * np.exp(2.0 * generator.standard_normal(6))
    change = change_of("slip_per_metre", list(zip(before.tolist(), after.tolist(), strict=True)))
    low, high = change.interval
    assert (change.difference - change.half_width) / change.before < -1.0
    assert -1.0 < low < change.relative < high


def test_what_vanishes_in_every_pair_is_less_by_all_of_it() -> None:
    change = change_of("slip_net_per_metre", [(0.1, 0.0), (0.2, 0.0), (0.12, 0.0)])
    assert (change.relative, change.interval, change.verdict) == (-1.0, (-1.0, -1.0), BETTER)


def test_a_mean_that_is_not_positive_has_no_ratio_and_is_judged_by_its_difference() -> None:
    change = change_of("stability_margin", [(0.02, -0.01), (0.021, -0.012), (0.019, -0.011)])
    assert all(map(math.isnan, change.interval))
    assert change.verdict == WORSE


@pytest.mark.parametrize(
    ("name", "values", "verdict"),
    [
        ("slip_per_metre", [(1.0, 0.5), (1.1, 0.6), (0.9, 0.41)], BETTER),
        ("slip_per_metre", [(0.5, 1.0), (0.6, 1.1), (0.41, 0.9)], WORSE),
        ("stability_margin", [(1.0, 0.5), (1.1, 0.6), (0.9, 0.41)], WORSE),
        ("realtime_factor", [(1.0, 0.5), (1.1, 0.6), (0.9, 0.41)], ""),
        ("slip_per_metre", [(1.0, 0.5), (1.0, 1.4), (1.0, 0.9)], SAME),  # the interval holds zero
        ("yaw_drift", [(5e-6, 8e-5), (5e-6, 8.1e-5)], SAME),  # sure, but no one could measure it
        ("slip_per_metre", [(0.3, 0.1)], BETTER),
        ("slip_per_metre", [(0.3, 0.299)], SAME),
        ("yaw_drift", [(0.0, 0.1)], WORSE),
        ("slip_net_per_metre", [(6.7e-18, 0.0)], SAME),
        ("slip_per_metre", [], ""),
        ("slip_per_metre", [(math.nan, 1.0)], ""),
    ],
)
def test_a_verdict_needs_a_change_that_is_sure_and_can_be_measured(
    name: str, values: list[tuple[float, float]], verdict: str
) -> None:
    assert change_of(name, values).verdict == verdict


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.0045, SAME), (0.0055, BETTER), (-0.0045, SAME), (-0.0055, WORSE)]
)
def test_a_single_pair_has_to_differ_by_half_a_percent(share: float, verdict: str) -> None:
    assert change_of("torque_rms", [(100.0, 100.0 * (1.0 - share))]).verdict == verdict


def test_a_metric_that_a_pair_lacks_is_judged_on_the_others() -> None:
    change = change_of("path_error", [(1.0, 0.5), (math.nan, 0.5), (1.0, 0.7)])
    assert change.pairs == 2
    assert change.after == pytest.approx(0.6)


def compared(first: list[Summary], second: list[Summary]) -> Comparisons:
    return compare_all({"kinematic": first, "compliant": second})


def test_a_fall_is_counted_and_reported_and_its_figures_left_out() -> None:
    first, second = runs("kinematic", [1.0, 1.0, 1.0]), runs("compliant", [0.5, 0.6, 90.0])
    second[2] = replace(second[2], upright=False, warnings=("the robot fell at 3 s",))
    comparison = compared(first, second)
    assert comparison.pairs[0].changes["slip_per_metre"].after == pytest.approx(0.55)
    assert comparison.walked == {"kinematic": 3, "compliant": 2}
    assert comparison.losses == ["compliant, seed 2: the robot fell at 3 s"]
    walked = comparison_rows(comparison)[0]
    assert (walked["values"], walked["verdict"]) == (["3 of 3", "2 of 3"], WORSE)
    assert "of the 2 in which both walked to the end" in about(comparison)


@pytest.mark.parametrize("status", [FAILED, REFUSED])
def test_a_run_without_figures_is_counted_and_reported(status: str) -> None:
    first, second = runs("kinematic", [1.0, 1.0]), runs("compliant", [0.5, 0.6])
    first[0] = Summary(
        control="kinematic",
        seed=0,
        status=status,
        reason="the step is too long",
        metrics=NO_FIGURES,
    )
    comparison = compared(first, second)
    assert comparison.means["compliant"]["slip_per_metre"] == 0.6
    assert comparison.losses == ["kinematic, seed 0: the step is too long"]
    assert comparison.as_table()["walked"] == {"kinematic": 1, "compliant": 2}


def test_runs_of_other_seeds_are_not_compared() -> None:
    with pytest.raises(HexapodError, match=r"seeds \[0, 1\] and \[0\]"):
        compare_runs(runs("kinematic", [1.0, 1.0]), runs("compliant", [1.0]))
    with pytest.raises(HexapodError, match="cannot be compared"):
        compare_runs([], [])


def test_the_file_of_all_runs_reads_back_bit_for_bit(tmp_path: Path) -> None:
    saved = runs("kinematic", [1.0 / 3.0, math.nan])
    saved[1] = replace(saved[1], warnings=("a, b", 'c "d"'), upright=False, fallback=0.1)
    saved += [
        Summary(
            control="compliant",
            seed=0,
            status=FAILED,
            reason="the FMU discards\nthe step",
            metrics=NO_FIGURES,
        )
    ]
    write_seeds(tmp_path / "seeds.csv", saved)
    again = read_seeds(tmp_path / "seeds.csv")
    assert list(again) == ["kinematic", "compliant"]
    for before, after in zip(saved, [*again["kinematic"], *again["compliant"]], strict=True):
        np.testing.assert_array_equal(list(before.metrics.values()), list(after.metrics.values()))
        assert replace(before, metrics={}) == replace(after, metrics={})


@pytest.mark.parametrize(
    ("text", "got"),
    [
        ("control,seed\nkinematic,0\n", "a file without status"),
        ("control,seed,status\nkinematic,x,completed\n", "a file that is no table of runs"),
    ],
)
def test_a_damaged_file_of_runs_is_refused_by_name(tmp_path: Path, text: str, got: str) -> None:
    (tmp_path / "seeds.csv").write_text(text)
    with pytest.raises(HexapodError, match=rf"seeds.csv: damaged file: got '{got}'.*hexapod comp"):
        read_seeds(tmp_path / "seeds.csv")
    with pytest.raises(HexapodError, match=r"missing.csv: no runs by seed"):
        read_seeds(tmp_path / "missing.csv")


def test_a_table_for_machines_has_relative_and_plain_figures() -> None:
    change = Change(
        before=2.0,
        after=1.0,
        half_width=0.2,
        log_half_width=math.log(1.25),
        pairs=3,
        floor=0.1,
        verdict=BETTER,
    )
    table = change.as_table()
    assert (table["relative"], table["difference"], table["half_width"]) == (-0.5, -1.0, 0.2)
    assert (table["low"], table["high"]) == (
        pytest.approx(0.5 / 1.25 - 1.0),
        pytest.approx(0.5 * 1.25 - 1.0),
    )
