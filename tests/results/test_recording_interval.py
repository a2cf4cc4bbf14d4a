"""Recordings with fewer rows than macro-steps: metrics and peaks stay, and both masters record the
same.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import Call
from gains import make_gains

from hexapod_cosim.controller import Gains
from hexapod_cosim.cosim.control.fmu_law import law_of_ours
from hexapod_cosim.cosim.interface.names import foot_names
from hexapod_cosim.cosim.master.loop import Outcome, diagnostic_columns, run
from hexapod_cosim.cosim.master.recorder import Peaks, Recorder, Recording, kept_moments
from hexapod_cosim.cosim.master.signals import Signals
from hexapod_cosim.cosim.results.metrics import compute_metrics, metric_columns
from hexapod_cosim.cosim.results.result import Result
from hexapod_cosim.cosim.results.walk import View
from hexapod_cosim.cosim.run.plan import make_plan
from hexapod_cosim.cosim.run.plant import initialise_plant, open_plant
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.run.walker import Walker
from hexapod_cosim.cosim.scenario.records import CONTROLS, Outputs, Scenario
from hexapod_cosim.cosim.scenario.scenario import load_scenario
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


def gains_of(scenario: Scenario) -> Gains | None:
    return (
        None
        if scenario.control == "kinematic"
        else make_gains(load_robot("athena"), period=scenario.macro_step)
    )


@pytest.fixture(scope="module", params=CONTROLS)
def runs(request: pytest.FixtureRequest, plant_build: Path) -> tuple[Result, Result]:
    """Records one walk at every macro-step of 1 ms, and every 20 ms: under kinematic control on
    the loop in Python, under the others on the loop in C.
    """
    plans = [walk_of(request.param, interval) for interval in (0.0, 0.02)]
    with Walker(everything=True) as walker:
        run_plan = simulate if request.param == "kinematic" else walker.simulate
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


def test_bounces_between_two_rows_leave_the_steepest_landing() -> None:
    peaks = Peaks(("RM.foot.landing_rate", "RM.foot.landings"))
    rows = np.array([(90.0, 0.0), (80.0, 1.0), (50.0, 2.0), (10.0, 3.0)])
    assert peaks.fold(rows)[0] == 80.0  # 90 is the rate of an older landing


@pytest.mark.parametrize(
    ("rows", "every", "kept"),
    [(7, 3, [0, 3, 6]), (9, 3, [0, 3, 6, 8]), (1, 4, [0]), (3, 1, [0, 1, 2])],
)
def test_the_last_row_is_always_kept(rows: int, every: int, kept: list[int]) -> None:
    assert kept_moments(rows, every).tolist() == kept


def in_python(scenario: Scenario, walker: Walker) -> Outcome:
    """Runs a scenario in the Python master with the plant FMU and the controller FMU."""
    plan = make_plan(scenario, gains=gains_of(scenario))
    controller = walker._controller_for(plan)
    controller.initialise(scenario.start, scenario.start + scenario.duration)
    with open_plant(scenario) as plant:
        initialise_plant(plant, plan)
        signals, ours = Signals(plant), law_of_ours(controller, period=scenario.macro_step)
        recorder = Recorder(
            signals,
            plan.schedule.times,
            plan.schedule.rows,
            extra=diagnostic_columns(ours),
            every=scenario.every,
            judged=metric_columns(bristles=True),
        )
        return run(plant, signals, ours, plan.schedule, recorder, h=scenario.macro_step)


def same(found: Recording, expected: Recording) -> None:
    names = [name for name in expected.names if name in found.names]
    assert set(names) == set(found.names)
    np.testing.assert_array_equal(found.columns(names), expected.columns(names))


@pytest.mark.parametrize("control", CONTROLS)
def test_both_masters_keep_the_same_rows(control: str) -> None:
    """They agree bit for bit.

    43 macro-steps are no multiple of the interval, so the last row is an extra one.
    """
    plan = load_scenario(
        "walk_flat",
        overrides=[f"control={control}", "duration=0.86", "gait.period=0.4", "macro_step=0.01"],
    )
    plan = replace(plan, duration=0.87, outputs=Outputs(interval=0.04))
    with Walker(everything=True) as walker:
        expected = in_python(plan, walker)
        found = walker.simulate(plan, gains=gains_of(plan)).outcome
        again = walker.simulate(plan, gains=gains_of(plan)).outcome
    assert found.recording.time == pytest.approx([*(0.04 * k for k in range(22)), 0.87])
    assert len(found.judged.time) == 88
    same(found.recording, expected.recording)
    same(found.judged, expected.judged)
    same(again.recording, expected.recording)
    assert (expected.recording.columns(foot_names("landings"))[-1] > 0.0).any()


def test_a_walker_that_keeps_what_is_judged_keeps_it_of_every_macro_step() -> None:
    plan = load_scenario(
        "walk_flat",
        overrides=["duration=1.2", "gait.period=0.4", "macro_step=0.01", "outputs.interval=0.04"],
    )
    with Walker() as walker:
        found = walker.simulate(plan)
    assert len(found.outcome.recording.time) == 121
    expected = simulate(plan)
    assert found.metrics["slip_per_metre"] == pytest.approx(
        expected.metrics["slip_per_metre"], rel=1e-6
    )


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
