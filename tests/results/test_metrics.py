"""Tests the metrics of a run, and those of a drop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from walks import CYCLES, PARAMETERS, PERIOD, SERVO, WEIGHT, H, SyntheticRun

from hexapod_cosim.cosim.interface.names import foot_names, joint_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.report.tables import metric_rows, number
from hexapod_cosim.cosim.results.metric_table import METRICS, Metrics
from hexapod_cosim.cosim.results.metrics import compute_metrics, percentiles
from hexapod_cosim.cosim.results.window import View
from hexapod_cosim.cosim.run.single_run import simulate
from hexapod_cosim.cosim.scenario.reading import load_scenario


def test_an_unknown_metric_is_refused_with_the_nearest_name() -> None:
    metrics = Metrics(slip_per_metre=0.2)
    assert metrics["slip_per_metre"] == 0.2
    with pytest.raises(KeyError, match=r"got 'slip_per_meter', .*'slip_per_metre'"):
        metrics["slip_per_meter"]


def test_the_metrics_are_those_of_the_contract_with_slip_after_what_is_exactly_measured() -> None:
    assert list(METRICS) == [
        "foot_error_stance",
        "foot_error_swing",
        "path_error",
        "yaw_drift",
        "height_rms",
        "roll_rms",
        "pitch_rms",
        "peak_force",
        "force_p95",
        "loading_rate",
        "torque_rms",
        "servo_load_max",
        "heat",
        "cost_of_transport",
        "electrical_cost",
        "path_error_per_radian",
        "yaw_drift_per_radian",
        "heat_per_radian",
        "cost_per_radian",
        "electrical_cost_per_radian",
        "stability_margin",
        "cone_use_p50",
        "cone_use_p95",
        "cone_use_over_90",
        "slip_per_metre",
        "slip_net_per_metre",
        "slip_per_radian",
        "energy_residual",
        "realtime_factor",
    ]
    assert list(SyntheticRun().metrics()) == list(METRICS)


def test_a_value_of_a_weighted_percentile_lies_in_the_middle_of_its_weight() -> None:
    """In order 1, 2 and 3 weigh 1, 1 and 2: their middles are at 0.5, 1.5 and 3 of 4."""
    values, weights = np.array([3.0, 1.0, 2.0]), np.array([2.0, 1.0, 1.0])
    # at 0.4, 0.5, 1, 2, 2.4 and 3.8
    found = percentiles(values, weights, (10.0, 12.5, 25.0, 50.0, 60.0, 95.0))
    assert found == pytest.approx([1.0, 1.0, 1.5, 7.0 / 3.0, 2.6, 3.0], rel=1e-12)


def test_forces_are_in_body_weights_and_the_percentile_is_of_loaded_feet() -> None:
    walk = SyntheticRun()
    force = np.linspace(0.0, 1.0, len(walk.time))
    walk.set("LF.foot.normal_force", force * WEIGHT)
    # between two rows
    walk.set("LF.foot.peak_force", np.where(np.abs(walk.time - 5.0) < 0.3 * H, 1.7, 0.0) * WEIGHT)
    metrics = walk.metrics()
    assert metrics["peak_force"] == pytest.approx(1.7)
    # of what rises from 0.2 to 1
    assert metrics["force_p95"] == pytest.approx(0.2 + 0.95 * 0.8, abs=1e-3)


def landings(
    walk: SyntheticRun, leg: str, times: list[float], rates: list[float], *, rising: float = 0.020
) -> None:
    """Returns touch-downs whose rate rises to its final value within `rising` [s], in body weights
    per second.
    """
    count, rate = np.zeros_like(walk.time), np.zeros_like(walk.time)
    for time, steepest in zip(times, rates, strict=True):
        since = walk.time - time
        count += since > 1e-9
        rate = np.where(since > 1e-9, steepest * np.clip(since / rising, 0.0, 1.0), rate)
    walk.set(f"{leg}.foot.landings", count)
    walk.set(f"{leg}.foot.landing_rate", rate * WEIGHT)


def test_loading_rate_is_a_percentile_over_landings() -> None:
    walk = SyntheticRun()
    # the first two cycles do not count
    landings(walk, "LF", [k + 0.5 for k in range(10)], [1000.0, 1000.0, *range(1, 9)])
    assert walk.metrics()["loading_rate"] == pytest.approx(1.0 + 0.95 * 7.0)


def test_a_foot_that_bounces_lands_once_with_the_steeper_rise() -> None:
    walk = SyntheticRun()
    landings(walk, "LF", [2.5, 2.55, 3.5, 3.55], [40.0, 10.0, 20.0, 60.0])
    assert walk.metrics()["loading_rate"] == pytest.approx(np.percentile([40.0, 60.0], 95))


@pytest.mark.parametrize(("apart", "rate"), [(0.45, 60.0), (0.55, 59.0)])
def test_touch_downs_more_than_half_a_cycle_apart_are_two_landings(
    apart: float, rate: float
) -> None:
    """The metric is the 95th percentile of one landing of 60, or of one of 40 and one of 60."""
    walk = SyntheticRun()
    landings(walk, "LF", [4.0, 4.0 + apart], [40.0, 60.0])
    assert walk.metrics()["loading_rate"] == pytest.approx(rate)


def test_torque_rms_is_over_all_joints_and_time() -> None:
    walk = SyntheticRun()
    walk.grow("LF.femur.torque_squared", 9.0)
    walk.set("LF.femur.torque", 100.0)  # at the rows' moments
    assert walk.metrics()["torque_rms"] == pytest.approx(3.0 / math.sqrt(18.0))


def test_heat_is_the_squared_torque_of_all_servos_per_metre_and_the_load_that_of_the_hottest() -> (
    None
):
    walk = SyntheticRun()
    walk.grow("LF.femur.torque_squared", 9.0)
    walk.grow("RR.tibia.torque_squared", 16.0)
    metrics = walk.metrics()
    assert metrics["heat"] == pytest.approx(25.0 / 0.08)
    assert metrics["servo_load_max"] == pytest.approx(4.0 / 1.2)  # of a rating of 1.2 N m


def test_cost_of_transport_counts_what_motors_drive_and_not_what_they_brake() -> None:
    walk = SyntheticRun()
    walk.grow("LF.femur.positive_work", 1.0)
    walk.grow("RF.femur.negative_work", 5.0)  # servos do not store it
    assert walk.metrics()["cost_of_transport"] == pytest.approx(1.0 / (0.08 * WEIGHT))


def test_electrical_cost_adds_the_copper_loss_by_the_motor_constant() -> None:
    """With 0.8 N m/sqrt(W) a torque of 2 N m costs 6.25 W while it stands still."""
    walk = SyntheticRun()
    walk.grow("LF.femur.positive_work", 1.0)
    walk.grow("RF.femur.torque_squared", 4.0)
    assert walk.metrics()["electrical_cost"] == pytest.approx(7.25 / (0.08 * WEIGHT))


def test_the_first_two_cycles_do_not_count() -> None:
    clean, dirty = SyntheticRun(), SyntheticRun()
    early = dirty.time < 2.0 * PERIOD - H / 2
    for name in (
        *foot_names("normal_force"),
        *foot_names("peak_force"),
        "torso.roll",
        "torso.position[3]",
    ):
        dirty.set(name, np.where(early, 7.0, 0.0))
    for name in (
        *joint_names("positive_work"),
        *joint_names("torque_squared"),
        *foot_names("slip_distance"),
    ):
        dirty.set(name, np.where(early, 7.0 * dirty.time, 14.0))
    assert dirty.metrics() == pytest.approx(clean.metrics(), nan_ok=True)


@pytest.mark.parametrize("cycles", [0, 1, 2])
def test_fewer_than_three_cycles_have_no_figures_but_those_of_the_run(cycles: int) -> None:
    metrics = SyntheticRun(cycles=cycles).metrics()
    assert metrics.pop("realtime_factor") == 42.0
    assert metrics.pop("energy_residual") == 0.0
    assert all(math.isnan(value) for value in metrics.values())


def test_the_energy_residual_is_the_largest_over_all_the_work_that_motors_did_and_took() -> None:
    walk = SyntheticRun()
    walk.grow("LF.femur.positive_work", 3.0)
    walk.grow("LF.femur.negative_work", 1.0)
    walk.set("energy.residual", np.where(np.abs(walk.time - 5.0) < 0.3 * H, -0.8, 0.2))
    assert walk.metrics()["energy_residual"] == pytest.approx(1.0 / 40.0)


def test_the_energy_residual_of_a_robot_at_rest_is_measured_by_a_lift_of_a_millimetre() -> None:
    walk = SyntheticRun(speed=0.0)
    walk.set("energy.residual", np.where(walk.time > 0.0, 1e-3 * WEIGHT, 0.0))
    assert walk.metrics()["energy_residual"] == pytest.approx(1.0)


def test_a_value_below_a_millionth_of_its_floor_reads_nought() -> None:
    assert number(6.7e-18, dust=1e-10) == "0"
    rows = metric_rows({"kinematic": dict.fromkeys(METRICS, 0.9e-10)}, net_slip=True)
    values = {row["name"]: row["values"][0] for row in rows}
    assert (values["height_rms"], values["peak_force"]) == ("0", "0")
    rows = metric_rows({"kinematic": dict.fromkeys(METRICS, 1.1e-10)}, net_slip=True)
    values = {row["name"]: row["values"][0] for row in rows}
    assert (values["height_rms"], values["peak_force"]) == ("1.1e-10", "0")
    assert number(-6.7e-18, dust=0.0) == "-6.7e-18"


def test_the_rating_and_the_motor_constant_are_the_robots() -> None:
    walk = SyntheticRun()
    walk.grow("LF.femur.torque_squared", 9.0)
    stronger = replace(SERVO, torque_continuous=3.0, motor_constant=1.5)
    view = View(walk.recording, PARAMETERS, PERIOD)
    metrics = compute_metrics(view, servo=stronger, realtime_factor=1.0)
    assert metrics["servo_load_max"] == pytest.approx(1.0)
    assert metrics["electrical_cost"] == pytest.approx(4.0 / (0.08 * WEIGHT))
    assert CYCLES == 10


# A drop, which is measured as a whole.

STIFF = "contact.stiffness=1e9"  # the weight acts for too short a time to matter
NEAR = 5e-3  # of the restitution: what is left of the weight's part


def impact_speeds(recording: Recording) -> list[float]:
    """Returns the mean speeds of the feet at the first two impacts of a drop [m/s]."""
    landed = np.flatnonzero(np.diff(recording.feet("landings").min(axis=1)) > 0.0) + 1
    return [float(recording.feet("impact_speed")[row].mean()) for row in landed[:2]]


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize(
    ("law", "delivered"), [("exact_restitution", 0.5), ("hunt_crossley", 0.6630)]
)
def test_a_stiff_ground_delivers_what_the_law_promises(law: str, delivered: float) -> None:
    """The robot flies freely in between, so it comes back with the speed at which it left."""
    scenario = load_scenario("drop", overrides=[STIFF, f"contact.law={law}", "duration=0.6"])
    first, second = impact_speeds(simulate(scenario).recording)
    assert second / first == pytest.approx(delivered, abs=NEAR)


@pytest.mark.usefixtures("plant_build")
@pytest.mark.parametrize("stiffness", [1e7, 1e9])
def test_the_peak_of_a_drop_is_that_of_a_hertz_impact(stiffness: float) -> None:
    """A sphere of a sixth of the mass stores its energy at its depth: 2/5 K d^(5/2) = E.

    The peak is neither rounded nor missed where the impact is shorter than a macro-step of 2 ms
    (0.7 ms at 1e9 N/m^1.5), and the metrics of a drop are of all of it.
    """
    law = ["contact.law=hertz", f"contact.stiffness={stiffness}", "duration=0.4"]
    result = simulate(load_scenario("drop", overrides=law))
    weight, mass, g = 54.936, 5.6 / 6, 9.81  # N of the robot, kg on a foot, m/s2
    depth = (result.metrics["peak_force"] * weight / stiffness) ** (2.0 / 3.0)
    energy = 0.5 * mass * impact_speeds(result.recording)[0] ** 2 + mass * g * depth
    assert 0.4 * stiffness * depth**2.5 == pytest.approx(energy, rel=1e-4)
    assert np.isnan(result.metrics["slip_per_metre"])
