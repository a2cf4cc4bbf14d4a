"""Every metric on synthetic walks whose figures are known in closed form."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from walks import CYCLES, DISTANCE, PARAMETERS, PERIOD, ROBOT, SPEED, WEIGHT, H, Walk

from hexapod_cosim.cosim.files import to_json
from hexapod_cosim.cosim.metrics import DUST, FLOORS, METRICS, View, commanded_path, compute_metrics, loading_rates
from hexapod_cosim.cosim.recorder import Recording
from hexapod_cosim.cosim.report import number
from hexapod_cosim.cosim.signals import foot_names, joint_names

Array = NDArray[np.float64]


def test_the_metrics_are_those_of_the_contract_in_its_order() -> None:
    assert list(METRICS) == [
        "slip_per_metre", "slip_net_per_metre", "path_error", "yaw_drift", "height_rms", "roll_rms", "pitch_rms", "peak_force", "force_p95",
        "loading_rate", "torque_rms", "cost_of_transport", "stability_margin", "realtime_factor",
    ]  # fmt: skip
    assert list(Walk().metrics()) == list(METRICS)


def test_weight_is_that_of_all_bodies() -> None:
    assert pytest.approx(ROBOT.total_mass * 9.81) == WEIGHT


def test_slip_counts_loaded_feet_per_metre_walked() -> None:
    walk = Walk()
    walk.set("LF.foot.slip_speed", 0.010)
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    walk.set("RM.foot.slip_speed", 0.005)
    walk.set("RM.foot.normal_force", 0.3 * WEIGHT)
    walk.set("LR.foot.slip_speed", 5.0)  # in the air
    walk.set("RR.foot.slip_speed", 5.0)  # touching, but not standing
    walk.set("RR.foot.normal_force", 0.009 * WEIGHT)
    assert walk.metrics()["slip_per_metre"] == pytest.approx(0.015 * (CYCLES - 2) * PERIOD / DISTANCE)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_creep_of_the_tanh_law_is_no_net_slip(share: float) -> None:
    mu, slope, normal = 0.7, 100.0, 0.3 * WEIGHT
    walk = Walk()
    walk.set("LF.foot.normal_force", normal)
    walk.set("LF.foot.tangential_force", share * mu * normal)
    walk.set("LF.foot.slip_speed", math.atanh(share) / slope)
    metrics = walk.metrics(friction__mu=mu, friction__slope=slope)
    assert metrics["slip_per_metre"] > 0.0
    assert metrics["slip_net_per_metre"] == pytest.approx(0.0, abs=1e-12)


def test_net_slip_is_what_exceeds_the_largest_creep() -> None:
    mu, slope, normal = 0.7, 100.0, 0.3 * WEIGHT
    walk = Walk()
    walk.set("LF.foot.normal_force", normal)
    walk.set("LF.foot.tangential_force", mu * normal)
    walk.set("LF.foot.slip_speed", 0.5)
    net = 0.5 - math.atanh(0.999) / slope
    assert walk.metrics(friction__mu=mu, friction__slope=slope)["slip_net_per_metre"] == pytest.approx(net / SPEED)


@pytest.mark.parametrize(("stretched", "turn", "net"), [(0.5, 1.0, 0.0), (1.0, 1.0, 1.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)])
def test_net_slip_of_bristles_is_what_they_do_not_give_back(stretched: float, turn: float, net: float) -> None:
    """A spring below break-away, sliding when full, elastic again on the way back; the normal velocity is no slip."""
    walk = Walk()
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    walk.set("LF.foot.slip_speed", 0.05)
    for axis, part in (("1", 0.6), ("2", 0.8)):
        walk.set(f"LF.foot.velocity[{axis}]", turn * part * 0.05)
        walk.set(f"LF.foot.bristle[{axis}]", part * stretched * 5e-4)
    walk.set("LF.foot.velocity[3]", 0.4)
    metrics = walk.metrics(friction__law=3.0, friction__presliding=5e-4)
    assert metrics["slip_per_metre"] == pytest.approx(0.05 / SPEED)
    assert metrics["slip_net_per_metre"] == pytest.approx(net * 0.05 / SPEED, abs=1e-12)


def test_a_walk_ten_percent_short_has_a_path_error_of_a_ninth() -> None:
    assert Walk(speed=0.9 * SPEED).metrics()["path_error"] == pytest.approx(0.1 / 0.9)
    assert Walk().metrics()["path_error"] == pytest.approx(0.0, abs=1e-12)


def test_the_commanded_path_sets_out_along_the_robots_own_heading() -> None:
    walk = Walk(speed=0.0)
    for angle in (0.3, -2.0):
        walk.set("torso.yaw", angle)
        walk.set("torso.position[1]", SPEED * math.cos(angle) * walk.time)
        walk.set("torso.position[2]", SPEED * math.sin(angle) * walk.time)
        assert walk.metrics()["path_error"] == pytest.approx(0.0, abs=1e-12)


def test_a_commanded_circle_is_followed_without_error() -> None:
    rate = 0.3
    walk = Walk()
    yaw = rate * walk.time
    walk.set("command.yaw_rate", rate)
    walk.set("torso.yaw", np.angle(np.exp(1j * yaw)))  # wraps at pi
    walk.set("torso.position[1]", SPEED / rate * np.sin(yaw))
    walk.set("torso.position[2]", SPEED / rate * (1.0 - np.cos(yaw)))
    metrics = walk.metrics()
    assert metrics["path_error"] == pytest.approx(0.0, abs=rate * H)  # the held command turns in steps
    assert metrics["yaw_drift"] == pytest.approx(0.0, abs=1e-12)


def test_yaw_drift_is_the_heading_lost_per_metre() -> None:
    walk = Walk()
    walk.set("torso.yaw", -0.01 * walk.time)
    assert walk.metrics()["yaw_drift"] == pytest.approx(0.01 / SPEED)


def test_the_torso_bobbing_within_a_cycle_walks_no_metre() -> None:
    walk = Walk()
    walk.set("LF.foot.normal_force", WEIGHT)
    walk.set("LF.foot.slip_speed", 0.01)
    walk.set("torso.position[3]", 0.05 * np.sin(2.0 * np.pi * walk.time / PERIOD))
    assert walk.metrics()["slip_per_metre"] == pytest.approx(0.01 / SPEED)


@pytest.mark.parametrize(
    ("column", "metric"), [("torso.position[3]", "height_rms"), ("torso.roll", "roll_rms"), ("torso.pitch", "pitch_rms")]
)
def test_an_oscillation_has_the_rms_of_a_sine_whatever_its_mean(column: str, metric: str) -> None:
    walk = Walk()
    walk.set(column, 0.2 + 0.01 * np.sin(2.0 * np.pi * walk.time / PERIOD))
    metrics = walk.metrics()
    assert metrics[metric] == pytest.approx(0.01 / math.sqrt(2.0), rel=1e-3)  # one row more than whole cycles
    assert all(metrics[other] == 0.0 for other in ("height_rms", "roll_rms", "pitch_rms") if other != metric)


def test_height_is_above_the_ground_that_rises() -> None:
    walk = Walk()
    walk.set("torso.position[3]", 0.13 + math.tan(0.1) * SPEED * walk.time)
    assert walk.metrics(terrain__kind=2, terrain__incline=0.1)["height_rms"] == pytest.approx(0.0, abs=1e-12)
    assert walk.metrics(terrain__kind=1, terrain__incline=0.1)["height_rms"] > 0.01


def test_forces_are_in_body_weights_and_the_percentile_is_of_loaded_feet() -> None:
    walk = Walk()
    force = np.linspace(0.0, 1.0, len(walk.time)) * WEIGHT
    walk.set("LF.foot.normal_force", force)
    judged = force[walk.time >= 2.0 * PERIOD] / WEIGHT
    metrics = walk.metrics()
    assert metrics["peak_force"] == pytest.approx(1.0)
    assert metrics["force_p95"] == pytest.approx(np.percentile(judged, 95))


def test_loading_rate_looks_at_twenty_milliseconds_after_touch_down_only() -> None:
    time: Array = H * np.arange(41.0)
    force, contact = np.zeros((41, 1)), np.zeros((41, 1), dtype=bool)
    contact[10:30] = True
    force[10:30, 0] = np.minimum(np.arange(1, 21), 5) * 2.0  # 2 per row until 10
    force[25, 0] = 1000.0  # long after
    rates = loading_rates(time, force, contact)
    assert rates == pytest.approx([400.0] * 5)  # the rise from the last free row, then the next 20 ms


def test_loading_rate_of_a_walk_is_its_percentile_in_body_weights_per_second() -> None:
    walk = Walk()
    phase = walk.time % PERIOD
    walk.set("LF.foot.contact", phase < 0.5)
    walk.set("LF.foot.normal_force", np.where(phase < 0.5, np.minimum(50.0 * (phase + H), 0.5), 0.0) * WEIGHT)
    assert walk.metrics()["loading_rate"] == pytest.approx(50.0, rel=1e-6)


def test_torque_rms_is_over_all_joints_and_time() -> None:
    walk = Walk()
    walk.set("LF.femur.torque", 3.0)
    assert walk.metrics()["torque_rms"] == pytest.approx(3.0 / math.sqrt(18.0))


def test_cost_of_transport_counts_positive_work_joint_by_joint() -> None:
    walk = Walk()
    walk.set("LF.femur.torque", 2.0)
    walk.set("LF.femur.speed", 0.5)
    walk.set("RF.femur.torque", -2.0)  # gives energy back: servos do not store it
    walk.set("RF.femur.speed", 0.5)
    assert walk.metrics()["cost_of_transport"] == pytest.approx(1.0 * (CYCLES - 2) * PERIOD / (WEIGHT * DISTANCE))


def test_the_first_two_cycles_do_not_count() -> None:
    clean, dirty = Walk(), Walk()
    early = dirty.time < 2.0 * PERIOD - H / 2
    for name in (*foot_names("normal_force"), *foot_names("slip_speed"), *joint_names("torque"), "torso.roll", "torso.position[3]"):
        dirty.set(name, np.where(early, 7.0, 0.0))
    assert dirty.metrics() == pytest.approx(clean.metrics(), nan_ok=True)


def test_a_cycle_begun_does_not_count() -> None:
    walk = Walk()
    walk.set("torso.roll", np.where(walk.time > 9.0 + 1e-9, 0.5, 0.0))
    shorter = Recording(walk.names, walk.data[walk.time < 9.7])
    assert compute_metrics(View(shorter, PARAMETERS, PERIOD), realtime_factor=1.0)["roll_rms"] == 0.0


def test_a_standing_robot_has_no_figures_per_metre_and_json_says_null() -> None:
    metrics = Walk(speed=0.0).metrics()
    per_metre = ("slip_per_metre", "slip_net_per_metre", "path_error", "yaw_drift", "cost_of_transport")
    assert all(math.isnan(metrics[name]) for name in per_metre)
    assert metrics["height_rms"] == 0.0
    assert json.loads(to_json(metrics))["slip_per_metre"] is None


@pytest.mark.parametrize("cycles", [0, 1, 2])
def test_fewer_than_three_cycles_have_no_figures_but_the_speed(cycles: int) -> None:
    metrics = Walk(cycles=cycles).metrics()
    assert metrics.pop("realtime_factor") == 42.0
    assert all(math.isnan(value) for value in metrics.values())


def test_the_commanded_path_turns_with_the_command() -> None:
    walk = Walk()
    walk.set("command.vx", np.where(walk.time < 5.0 - H / 2, 0.1, 0.0))
    walk.set("command.vy", np.where(walk.time < 5.0 - H / 2, 0.0, 0.1))
    path = commanded_path(walk.recording)
    assert path[-1] == pytest.approx([0.5, 0.5])


def test_every_metric_has_a_floor_and_what_is_dust_to_it_reads_nought() -> None:
    assert set(FLOORS) == set(METRICS)
    assert number(6.7e-18, dust=DUST * FLOORS["slip_net_per_metre"]) == "0"
    assert number(-6.7e-18, dust=0.0) == "-6.7e-18"
