"""The histogram of doStep: figures of times that are given, and a walk that is timed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import Call

from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.extensions.live.realtime import (
    StepTimes,
    facts_of,
    goal_met,
    measure,
    table_of,
)
from hexapod_cosim.models import HexapodError


def made(*thread: float, touched: int = 0) -> StepTimes:
    """Times of steps [us], of which the first `touched` have a touch-down."""
    values = np.array(thread)
    return StepTimes(0.001, values, 2.0 * values, np.arange(len(values)) < touched)


def test_figures_are_quantiles_and_counts_by_clock_and_kind_of_step() -> None:
    times = made(400.0, 20.0, *np.linspace(10.0, 30.0, 998), touched=2)
    facts = facts_of(times)
    assert (facts["steps"], facts["touch_downs"], facts["goal_met"]) == (1000, 2, False)
    whole = facts["times"]["thread time, all steps"]
    assert whole["50 %"] == pytest.approx(20.0, abs=0.1)
    assert (whole["largest"], whole["above 100 us"], whole["above 300 us"]) == (400.0, 1, 1)
    assert facts["times"]["wall time, all steps"]["largest"] == 800.0
    assert facts["times"]["thread time, with a touch-down"]["largest"] == 400.0
    heading, rows = table_of(facts)
    assert heading[0] == "us"
    assert [row[0] for row in rows] == [
        "thread time, all steps",
        "thread time, with a touch-down",
        "wall time, all steps",
        "wall time, with a touch-down",
    ]
    assert rows[0][-3:] == ["400", "1", "1"]


@pytest.mark.parametrize(
    ("slow", "met"),
    [([], True), ([299.0], True), ([299.0, 150.0], False), ([301.0], False)],
)
def test_the_goal_is_met_by_one_slow_step_in_ten_thousand_below_the_worst(
    slow: list[float], met: bool
) -> None:
    assert goal_met(np.array([20.0] * (10_000 - len(slow)) + slow)) is met


def test_a_walk_is_timed_step_by_step_with_its_touch_downs() -> None:
    scenario = load_scenario("walk_flat")
    times = measure(scenario, step=0.001, count=2500)
    assert len(times.thread) == len(times.wall) == 2500
    assert times.thread.min() > 0.0
    # all six feet have swung at least once in the 2.5 s of a tripod gait with a period of 1 s
    assert 4 <= times.touched.sum() <= 60


def test_too_few_steps_are_refused() -> None:
    with pytest.raises(HexapodError, match="too few steps: got 10, expected at least 1000"):
        measure(load_scenario("walk_flat"), step=0.001, count=10)


def test_the_command_prints_its_figures_and_writes_the_histogram(
    call: Call, tmp_path: Path
) -> None:
    options = ["--control", "kinematic", "--steps", "1000", "-o", tmp_path, "--json"]
    code, out, err = call("realtime", "stand", *options)
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert facts["steps"] == 1000
    assert facts["written"] == [str(tmp_path / f"realtime.{kind}") for kind in ("png", "svg")]
    assert all(Path(name).stat().st_size > 0 for name in facts["written"])
