"""Recordings with fewer rows than macro-steps: metrics and peaks stay, and both masters record the
same.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command import Call
from gains import gains_of

from hexapod_cosim.cosim.interface.names import foot_names
from hexapod_cosim.cosim.master.recorder import Peaks, Recording
from hexapod_cosim.cosim.results.facts import Result
from hexapod_cosim.cosim.results.metrics import compute_metrics
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.cosim.run.runner import Runner
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario
from hexapod_cosim.cosim.scenario.records import CONTROLS, Scenario
from hexapod_cosim.models import load_robot

FOLDED = (*foot_names("peak_force"), *foot_names("peak_force_rate"), *foot_names("landing_rate"))
# of rows 20 ms apart alone: what the plant measures, and what changes slowly
OF_ROWS = (
    "slip_per_metre",
    "path_error",
    "height_rms",
    "peak_force",
    "loading_rate",
    "torque_rms",
    "servo_load_max",
    "heat",
    "cost_of_transport",
    "electrical_cost",
)
NEAR = 0.01  # of a figure, between rows 1 ms and 20 ms apart

pytestmark = pytest.mark.usefixtures("plant_build")


def walk_of(control: str, interval: float) -> Scenario:
    settings = (
        f"control={control}",
        "macro_step=0.001",
        "duration=2.4",
        "gait.period=0.8",
        "outputs.plots=false",
    )
    return load_scenario("walk_flat", overrides=[*settings, f"outputs.interval={interval}"])


@pytest.fixture(scope="module", params=CONTROLS)
def runs(request: pytest.FixtureRequest, plant_build: Path) -> tuple[Result, Result]:
    """Records one walk at every macro-step of 1 ms, and every 20 ms: under kinematic control on
    the loop in Python, under the others on the loop in C.
    """
    plans = [walk_of(request.param, interval) for interval in (0.0, 0.02)]
    with Runner(everything=True) as runner:
        run_plan = simulate if request.param == "kinematic" else runner.simulate
        every, coarse = (run_plan(plan, gains=gains_of(plan)) for plan in plans)
    return every, coarse


def test_the_figures_of_a_run_do_not_depend_on_the_rows_that_are_kept(
    runs: tuple[Result, Result],
) -> None:
    every, coarse = runs
    assert len(every.outcome.recording.time) == 2401
    assert len(coarse.outcome.recording.time) == 121
    for name, value in every.metrics.items():
        if name != "realtime_factor":
            assert coarse.metrics[name] == pytest.approx(value, rel=0.0, abs=0.0, nan_ok=True), name
    assert coarse.facts.warnings == every.facts.warnings


def test_what_the_plant_measures_can_be_had_from_rows_far_apart(
    runs: tuple[Result, Result],
) -> None:
    """The kept rows alone give the metrics within 1 %, or 10 um of the torso's height."""
    every, coarse = runs
    view = View(coarse.outcome.recording, coarse.parameters, 0.8)
    found = compute_metrics(view, servo=load_robot("athena").servo, realtime_factor=1.0)
    for name in OF_ROWS:
        assert found[name] == pytest.approx(every.metrics[name], rel=NEAR, abs=1e-5), name


def test_rows_are_left_out_and_their_peaks_are_not(runs: tuple[Result, Result]) -> None:
    every, coarse = (result.outcome.recording for result in runs)
    assert coarse.names == every.names
    plain = [name for name in every.names if name not in FOLDED]
    np.testing.assert_array_equal(coarse.columns(plain), every.columns(plain)[::20])
    for name in (*foot_names("peak_force"), *foot_names("peak_force_rate")):
        values = every.column(name)
        largest = [values[0], *values[1:].reshape(-1, 20).max(axis=1)]
        np.testing.assert_array_equal(coarse.column(name), largest)
    assert (
        coarse.columns(foot_names("peak_force")) > every.columns(foot_names("peak_force"))[::20]
    ).any()


def test_the_rate_of_a_landing_is_that_of_the_touch_downs_since_the_last_row() -> None:
    peaks = Peaks(("LF.foot.peak_force", "LF.foot.landing_rate", "LF.foot.landings"))
    kept_rows = [
        [(5.0, 9.0, 1)],
        [(7.0, 9.0, 1), (1.0, 2.0, 2), (2.0, 4.0, 2)],
        [(3.0, 4.0, 2)],  # nothing new
        [(0.0, 1.0, 3), (0.0, 3.0, 3)],
    ]
    shown = [tuple(peaks.fold(np.array(rows))[:2]) for rows in kept_rows]
    assert shown == [(5.0, 9.0), (7.0, 4.0), (3.0, 4.0), (0.0, 3.0)]


def same(found: Recording, expected: Recording) -> None:
    names = [name for name in expected.names if name in found.names]
    assert set(names) == set(found.names)
    np.testing.assert_array_equal(found.columns(names), expected.columns(names))


def test_commands_are_written_only_where_all_of_them_are_recorded(
    call: Call, tmp_path: Path
) -> None:
    changes = ("--set", "duration=0.2", "--set", "outputs.plots=false")
    assert call("simulate", "stand", "-o", tmp_path / "all", *changes)[0] == 0
    assert (
        call(
            "simulate",
            "stand",
            "-o",
            tmp_path / "some",
            *changes,
            "--set",
            "outputs.interval=20 ms",
        )[0]
        == 0
    )
    assert (tmp_path / "all" / "commands.csv").is_file()
    assert not (tmp_path / "some" / "commands.csv").exists()
    assert len((tmp_path / "some" / "results.csv").read_text(encoding="utf-8").splitlines()) == 12
