"""Tests figures of the course, and its intervals against closed forms and against chance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.cosim.master.loop import COMPLETED, FAILED
from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.cosim.results.summary import NO_FIGURES, Summary
from hexapod_cosim.extensions.course import texts
from hexapod_cosim.extensions.course.records import BY_NAME, QUANTITIES, Case, load_course
from hexapod_cosim.extensions.course.report import COLUMNS, panels
from hexapod_cosim.extensions.course.runs import Run, failure_of
from hexapod_cosim.extensions.course.statistics import Rate, median_ratio
from hexapod_cosim.extensions.course.table import ALL, Table

CONTROLS = ("before", "after")
COURSE = load_course("judge", seeds=4)


def case_of(name: str) -> Case:
    return next(case for case in COURSE.cases if case.name == name)


def run_of(
    case: str, control: str, seed: int, values: Mapping[str, float], failure: str = ""
) -> Run:
    all_values = dict.fromkeys((item.name for item in QUANTITIES), 1.0) | dict(values)
    return Run(case, control, seed, failure, all_values)


def table_of(figures: Mapping[str, tuple[float, float]], quantity: str) -> Table:
    """Returns a table with the values of a quantity under both controls in some cases."""
    course = replace(COURSE, cases=tuple(case_of(name) for name in figures))
    runs = tuple(
        run_of(name, control, seed, {quantity: value})
        for name, values in figures.items()
        for seed in course.seeds
        for control, value in zip(CONTROLS, values, strict=True)
    )
    return Table(course, CONTROLS, runs)


def summary_of(**metrics: float) -> Summary:
    figures = dict.fromkeys(METRICS, 0.1) | {"energy_residual": 1e-5} | metrics
    return Summary(control="kinematic", seed=0, status=COMPLETED, upright=True, metrics=figures)


def test_a_robot_that_walks_to_the_commanded_end_is_a_success() -> None:
    assert failure_of(summary_of(path_error=0.49), arrive=0.5) == ""
    turned = summary_of(path_error=math.nan, yaw_drift_per_radian=0.49)
    assert failure_of(turned, arrive=0.5) == ""


@pytest.mark.parametrize(
    ("summary", "text"),
    [
        (summary_of(path_error=0.51), "did not arrive"),
        (summary_of(path_error=math.nan, yaw_drift_per_radian=0.6), "did not arrive"),
        (summary_of(path_error=math.nan, yaw_drift_per_radian=math.nan), "did not get ahead"),
        (summary_of(energy_residual=0.02), "not valid"),
        (replace(summary_of(), upright=False, warnings=("the robot fell at 3 s",)), "fell at 3 s"),
        (
            Summary(control="x", seed=0, status=FAILED, reason="stopped", metrics=NO_FIGURES),
            "stopped",
        ),
    ],
)
def test_any_other_end_is_a_failure_with_its_reason(summary: Summary, text: str) -> None:
    assert text in failure_of(summary, arrive=0.5)


def test_turns_on_the_spot_are_judged_per_radian() -> None:
    metrics = dict.fromkeys(METRICS, 7.0)
    metrics |= {"heat": math.nan, "heat_per_radian": 3.0, "roll_rms": 3.0, "pitch_rms": 4.0}
    assert BY_NAME["heat"].value(metrics) == 3.0
    assert BY_NAME["slip"].value(metrics) == 7.0
    assert BY_NAME["tilt"].value(metrics) == 5.0


def test_failures_are_in_no_mean_and_their_partners_in_no_ratio() -> None:
    course = replace(COURSE, cases=(case_of("flat_tanh"),))
    values = {"before": (1.0, 2.0, 3.0, 100.0), "after": (2.0, 4.0, 100.0, 6.0)}
    failures = {("before", 3): "stuck", ("after", 2): "stuck"}
    runs = tuple(
        run_of("flat_tanh", control, seed, {"slip": values[control][seed]},
               failures.get((control, seed), ""))
        for seed in range(4)
        for control in CONTROLS
    )  # fmt: skip
    figures = Table(course, CONTROLS, runs).cases["flat_tanh", "after"]
    assert (figures.success.successes, figures.success.runs) == (3, 4)
    assert figures.mean("slip").value == 4.0
    assert figures.change("slip").relative == 1.0
    assert figures.change("slip").pairs == 2
    assert figures.failures == {"stuck": 1}
    assert figures.counts("slip")


def test_a_case_with_few_pairs_is_in_no_median() -> None:
    course = replace(COURSE, cases=(case_of("flat_tanh"),))
    runs = tuple(
        run_of("flat_tanh", control, seed, {}, "stuck" if seed else "")
        for seed in range(4)
        for control in CONTROLS
    )
    found = Table(course, CONTROLS, runs).classes["flat", "after"]
    assert found.counted("slip") == 0
    assert math.isnan(found.ratio("slip").value)


def test_class_figures_are_medians_over_cases() -> None:
    table = table_of(
        {"sand": (1.0, 0.5), "sand_wide": (2.0, 0.5), "mud": (1.0, 3.0), "mu_03": (1.0, 0.1)},
        "heat",
    )
    assert table.classes["soil", "after"].ratio("heat").value == 0.5
    # of 0.5, 0.25, 3 and 0.1
    assert table.classes[ALL, "after"].ratio("heat").value == pytest.approx(0.375)
    assert table.classes["soil", "after"].success.runs == 12


def test_compliant_control_is_compared_in_the_tripod_and_in_its_own_walk() -> None:
    controls = ("kinematic", "kinematic@chosen", "compliant")
    course = replace(COURSE, cases=(case_of("flat_tanh"),))
    runs = tuple(
        run_of("flat_tanh", control, seed, {"slip": slip})
        for seed in course.seeds
        for control, slip in zip(controls, (4.0, 2.0, 1.0), strict=True)
    )
    table = Table(course, controls, runs)
    _, rows = texts.class_rows(table)
    assert [row[1:5] for row in rows] == [
        ["kinematic", "", "100 (51..100)", "ref."],
        ["kinematic@chosen", "kinematic", "100 (51..100)", "-50"],
        ["compliant", "kinematic", "100 (51..100)", "-75"],
        ["compliant", "kinematic@chosen", "100 (51..100)", "-50"],
    ]
    assert len(texts.case_rows(table)[1]) == 3


def sweep_table(first_failures: Mapping[str, int], second_failures: Mapping[str, int]) -> Table:
    """Returns a table of both sweeps with numbers of failures by case, of 4 runs."""
    cases = tuple(case for case in COURSE.cases if case.sweep)
    runs = tuple(
        run_of(case.name, control, seed, {}, "stuck" if seed < failures.get(case.name, 0) else "")
        for case in cases
        for seed in COURSE.seeds
        for control, failures in zip(CONTROLS, (first_failures, second_failures), strict=True)
    )
    return Table(replace(COURSE, cases=cases), CONTROLS, runs)


def test_cells_are_green_where_a_figure_falls_and_orange_where_it_rises() -> None:
    table = table_of({"flat_tanh": (1.0, 0.25), "sand": (1.0, 2.0)}, "heat")
    rows = panels(table)["after against before"]
    cells = {name: dict(zip(COLUMNS, cells, strict=True))["heat"] for _, name, cells in rows}
    assert (cells["flat_tanh"].text, cells["flat_tanh"].shade) == ("-75", -1.0)
    assert (cells["sand"].text, cells["sand"].shade) == ("+100", 0.5)
    assert "--better" in cells["flat_tanh"].colour
    assert "--worse" in cells["sand"].colour


def test_tables_have_a_cell_for_every_column() -> None:
    table = sweep_table({"stairs_25": 4}, {"rubble_40": 1})
    for columns, rows in (
        texts.case_rows(table),
        texts.class_rows(table),
        texts.failure_rows(table),
        texts.sweep_rows(table),
    ):
        assert rows
        assert {len(row) for row in rows} == {len(columns)}


# Intervals of the course against closed forms and against chance.


def test_wilsons_interval_solves_its_equation() -> None:
    z = 1.959963984540054  # normal quantile of 97.5 %
    for successes, runs in ((3, 10), (1, 4), (57, 60), (5, 10)):
        found = Rate(successes, runs).interval
        share = successes / runs
        assert found.value == share
        for end in (found.low, found.high):
            assert (end - share) ** 2 == pytest.approx(z**2 * end * (1.0 - end) / runs, rel=1e-12)
        assert found.low < share < found.high


def test_no_and_all_successes_have_one_sided_intervals() -> None:
    z = 1.959963984540054
    none, every = Rate(0, 10).interval, Rate(10, 10).interval
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
