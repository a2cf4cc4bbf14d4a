"""Every metric on synthetic walks for which it is known in closed form."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from walks import CYCLES, DISTANCE, PARAMETERS, PERIOD, ROBOT, SERVO, SPEED, WEIGHT, H, Walk

from hexapod_cosim.cosim.common.files import to_json
from hexapod_cosim.cosim.interface.names import foot_names, joint_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.report.report import metric_rows, number
from hexapod_cosim.cosim.results.balance import Unbalanced
from hexapod_cosim.cosim.results.metrics import FLOORS, METRICS, compute_metrics, shown_metrics
from hexapod_cosim.cosim.results.walk import View, body_height, commanded_path, held_integral

Array = NDArray[np.float64]

PER_METRE = (
    "slip_per_metre",
    "path_error",
    "yaw_drift",
    "heat",
    "cost_of_transport",
    "electrical_cost",
)
TWINS = (
    "slip_per_radian",
    "path_error_per_radian",
    "yaw_drift_per_radian",
    "heat_per_radian",
    "cost_per_radian",
    "electrical_cost_per_radian",
)
JUDGED = 8.0  # s    of ten cycles of 1 s


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
    assert list(Walk().metrics()) == list(METRICS)


def test_weight_is_that_of_all_bodies() -> None:
    assert pytest.approx(ROBOT.total_mass * 9.81) == WEIGHT


def test_slip_is_what_the_plant_counted_per_metre_walked() -> None:
    walk = Walk()
    walk.grow("LF.foot.slip_distance", 0.010)
    walk.grow("RM.foot.slip_distance", 0.005)
    walk.set("LF.foot.slip_speed", 5.0)  # what the rows show at their moments does not count
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    assert walk.metrics()["slip_per_metre"] == pytest.approx(0.015 * JUDGED / DISTANCE)


@pytest.mark.parametrize("h", [0.005, 0.02, 0.03])  # of 0.03 s no row is at 2 s
def test_cumulative_figures_depend_on_no_row(h: float) -> None:
    """Steady growth gives the same in the measured time, whether or not rows lie at its ends."""
    walk = Walk(h=h)
    walk.grow("LF.foot.slip_distance", 0.010)
    walk.grow("LF.femur.positive_work", 3.0)
    walk.grow("LF.femur.torque_squared", 4.0)
    metrics = walk.metrics()
    assert metrics["slip_per_metre"] == pytest.approx(0.010 / 0.08)
    assert metrics["cost_of_transport"] == pytest.approx(3.0 / (0.08 * WEIGHT))
    assert metrics["torque_rms"] == pytest.approx(2.0 / math.sqrt(18.0))
    assert metrics["path_error"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("load", [0.02, 0.3])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_creep_of_the_tanh_law_is_no_net_slip(share: float, load: float) -> None:
    mu, slope, normal = 0.7, 100.0, load * WEIGHT
    walk = Walk()
    walk.set("LF.foot.normal_force", normal)
    walk.set("LF.foot.tangential_force", share * mu * normal)
    walk.set("LF.foot.slip_speed", math.atanh(share) / slope)
    assert walk.metrics(friction__mu=mu, friction__slope=slope)[
        "slip_net_per_metre"
    ] == pytest.approx(0.0, abs=1e-12)


def test_net_slip_is_what_exceeds_the_largest_creep() -> None:
    mu, slope, normal = 0.7, 100.0, 0.3 * WEIGHT
    walk = Walk()
    walk.set("LF.foot.normal_force", normal)
    walk.set("LF.foot.tangential_force", mu * normal)
    walk.set("LF.foot.slip_speed", 0.5)
    walk.set("RM.foot.slip_speed", 0.5)  # in the air
    net = 0.5 - math.atanh(0.999) / slope
    assert walk.metrics(friction__mu=mu, friction__slope=slope)[
        "slip_net_per_metre"
    ] == pytest.approx(net / SPEED)


@pytest.mark.parametrize(
    ("stretched", "turn", "net"),
    [(0.5, 1.0, 0.0), (1.0, 1.0, 1.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)],
)
def test_net_slip_of_bristles_is_what_they_do_not_give_back(
    stretched: float, turn: float, net: float
) -> None:
    """A bristle is a spring below break-away, slides when full, and springs back.

    Velocity along the normal is no slip.
    """
    walk = Walk()
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    for axis, part in (("1", 0.6), ("2", 0.8)):
        walk.set(f"LF.foot.velocity[{axis}]", turn * part * 0.05)
        walk.set(f"LF.foot.bristle[{axis}]", part * stretched * 5e-4)
    walk.set("LF.foot.velocity[3]", 0.4)
    metrics = walk.metrics(friction__law=3.0, friction__presliding=5e-4)
    assert metrics["slip_net_per_metre"] == pytest.approx(net * 0.05 / SPEED, abs=1e-12)


def use_cone(walk: Walk, share: float, rate: Array | float = 1.0) -> None:
    """Adds loaded feet that use this share of the cone, `rate` of them at a time (rows,).

    A bin begins at 0.9 (i/30)^2.
    """
    bins = [0.9 * (i / 30.0) ** 2 for i in range(31)]
    walk.grow(f"feet.cone_time[{sum(share >= begin for begin in bins)}]", rate)


def test_cone_use_is_what_the_plant_counted_over_time() -> None:
    """At 11 % for the most, at 20 %, and at 95 % of the cone for a tenth of the time.

    What rows show at their moments does not count.
    """
    walk = Walk()
    high = np.where(walk.time % PERIOD < 0.25, 1.0, 0.0)
    use_cone(walk, 0.11, 1.5)
    use_cone(walk, 0.20, 1.0 - high)
    use_cone(walk, 0.95, high)
    walk.set("LF.foot.normal_force", 0.3 * WEIGHT)
    walk.set("LF.foot.tangential_force", 0.3 * WEIGHT)
    metrics = walk.metrics(friction__mu=0.7)
    assert metrics["cone_use_over_90"] == pytest.approx(0.10, abs=1e-3)
    assert 0.9 < metrics["cone_use_p95"] < 1.0
    assert 0.10 <= metrics["cone_use_p50"] <= 0.13


def test_cone_use_before_the_judged_cycles_does_not_count() -> None:
    walk = Walk()
    use_cone(walk, 0.5, np.where(walk.time > 2.0, 1.0, 0.0))
    use_cone(walk, 0.95, np.where(walk.time > 2.0, 0.0, 100.0))
    metrics = walk.metrics(friction__mu=0.7)
    assert metrics["cone_use_p50"] == pytest.approx(0.50, abs=0.03)


@pytest.mark.parametrize(
    ("largest", "p50", "p95", "bin_width"), [(0.80, 0.40, 0.76, 0.056), (0.10, 0.05, 0.095, 0.021)]
)
def test_cone_use_is_told_by_percentiles_over_time(
    largest: float, p50: float, p95: float, bin_width: float
) -> None:
    """From nothing to the largest share, evenly in time: within half a bin at the last
    percentile, much less in between.
    """
    walk = Walk()
    for i in range(30):
        begin, end = 0.9 * (i / 30.0) ** 2, 0.9 * ((i + 1) / 30.0) ** 2
        within = max(min(end, largest) - begin, 0.0) / largest
        if within > 0.0:
            use_cone(walk, 0.5 * (begin + end), within)
    metrics = walk.metrics(friction__mu=0.7)
    assert metrics["cone_use_p50"] == pytest.approx(p50, rel=0.03)
    assert metrics["cone_use_p95"] == pytest.approx(p95, abs=0.5 * bin_width)
    assert metrics["cone_use_over_90"] == 0.0


@pytest.mark.parametrize(("share", "over"), [(0.89, 0.0), (0.91, 1.0)])
def test_nearly_sliding_is_over_nine_tenths_of_the_cone(share: float, over: float) -> None:
    walk = Walk()
    use_cone(walk, share)
    assert walk.metrics(friction__mu=0.7)["cone_use_over_90"] == pytest.approx(over)


@pytest.mark.parametrize(("load", "counts"), [(0.0095, False), (0.0105, True)])
def test_a_foot_stands_on_a_hundredth_of_the_weight(load: float, counts: bool) -> None:
    walk = Walk()
    walk.set("LF.foot.normal_force", load * WEIGHT)
    metrics = walk.metrics(friction__mu=0.7)
    assert math.isfinite(metrics["force_p95"]) == counts
    assert math.isnan(metrics["cone_use_p95"])  # the plant counted no time


@pytest.mark.parametrize(
    "ground", [{"friction__mu": 0.0}, {"friction__law": 2.0}], ids=["no friction", "no law"]
)
def test_a_cone_that_is_not_there_is_not_used(ground: dict[str, float]) -> None:
    walk = Walk()
    use_cone(walk, 0.3)
    metrics = walk.metrics(**ground)
    assert all(
        math.isnan(metrics[name]) for name in ("cone_use_p50", "cone_use_p95", "cone_use_over_90")
    )


def test_feet_are_compared_with_their_plan_in_the_torsos_frame() -> None:
    """The torso is turned, tilted and away from the origin.

    Each foot is 3 mm off its plan in stance, one is 6 mm off in swing.
    """
    walk = Walk(planned=True)
    yaw, com = 0.9, np.array([0.02, -0.01, 0.03])
    walk.set("torso.quaternion[1]", math.cos(yaw / 2.0))
    walk.set("torso.quaternion[4]", math.sin(yaw / 2.0))
    turn = np.array(
        [[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
    )
    torso = walk.recording.vector("torso.position")
    swinging = walk.time % PERIOD < 0.5
    walk.set("controller.LF.swinging", swinging)
    for k, leg in enumerate(("LF", "LM", "LR", "RF", "RM", "RR")):
        plan = np.array([0.1 * k, 0.2, -0.12])
        off = np.where(swinging[:, None] & (leg == "LF"), [0.0, 0.006, 0.0], [0.001, 0.002, -0.002])
        centre = torso + (plan + off - com) @ turn.T
        for i in range(3):
            walk.set(f"controller.{leg}.planned[{i + 1}]", plan[i])
            walk.set(f"{leg}.foot.position[{i + 1}]", centre[:, i] - (0.015 if i == 2 else 0.0))
    changes = {f"torso.com[{i + 1}]": float(com[i]) for i in range(3)}
    metrics = walk.metrics(foot__radius=0.015, **changes)
    assert metrics["foot_error_stance"] == pytest.approx(0.003)
    assert metrics["foot_error_swing"] == pytest.approx(0.006)


def test_feet_on_a_slope_have_their_centres_above_the_ground_along_its_normal() -> None:
    walk, incline, heading = Walk(planned=True), 0.2, 0.7
    for leg in ("LF", "LM", "LR", "RF", "RM", "RR"):
        for i, part in enumerate(
            [
                -math.sin(incline) * math.cos(heading),
                -math.sin(incline) * math.sin(heading),
                math.cos(incline),
            ]
        ):
            walk.set(f"controller.{leg}.planned[{i + 1}]", 0.015 * part)
            walk.set(
                f"{leg}.foot.position[{i + 1}]", walk.recording.column(f"torso.position[{i + 1}]")
            )
    ground = {"terrain__incline": incline, "terrain__heading": heading}
    assert walk.metrics(terrain__kind=2, **ground)["foot_error_stance"] == pytest.approx(
        0.0, abs=1e-12
    )
    assert walk.metrics(terrain__kind=1, **ground)["foot_error_stance"] > 1e-3


def test_a_controller_that_tells_no_plan_has_no_foot_errors() -> None:
    metrics = Walk().metrics()
    assert math.isnan(metrics["foot_error_stance"])
    assert math.isnan(metrics["foot_error_swing"])


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


def test_the_commanded_path_sets_out_along_the_mean_heading_of_a_cycle() -> None:
    """A torso that swings by 0.1 rad about its way walks along that way.

    Its yaw in the first row does not matter.
    """
    walk = Walk()
    walk.set("torso.yaw", 0.1 * np.cos(2.0 * np.pi * walk.time / PERIOD + 0.7))
    assert walk.metrics()["path_error"] == pytest.approx(0.0, abs=1e-6)


def test_a_commanded_circle_is_followed_without_error() -> None:
    rate = 0.3
    walk = Walk()
    yaw = rate * walk.time
    walk.set("command.yaw_rate", rate)
    walk.set("torso.yaw", np.angle(np.exp(1j * yaw)))  # wraps at pi
    walk.set("torso.position[1]", SPEED / rate * np.sin(yaw))
    walk.set("torso.position[2]", SPEED / rate * (1.0 - np.cos(yaw)))
    metrics = walk.metrics()
    # the held command turns in steps
    assert metrics["path_error"] == pytest.approx(0.0, abs=rate * H)
    assert metrics["yaw_drift"] == pytest.approx(0.0, abs=1e-12)


def test_yaw_drift_is_the_heading_lost_per_metre() -> None:
    walk = Walk()
    walk.set("torso.yaw", -0.01 * walk.time)
    assert walk.metrics()["yaw_drift"] == pytest.approx(0.01 / SPEED)


def test_the_torso_bobbing_within_a_cycle_walks_no_metre() -> None:
    walk = Walk()
    walk.grow("LF.foot.slip_distance", 0.01)
    walk.set("torso.position[3]", 0.05 * np.sin(2.0 * np.pi * walk.time / PERIOD))
    assert walk.metrics()["slip_per_metre"] == pytest.approx(0.01 / SPEED)


@pytest.mark.parametrize("h", [0.005, 0.02])
@pytest.mark.parametrize(
    ("column", "metric"),
    [("torso.position[3]", "height_rms"), ("torso.roll", "roll_rms"), ("torso.pitch", "pitch_rms")],
)
def test_an_oscillation_has_the_rms_of_a_sine_whatever_its_mean(
    column: str, metric: str, h: float
) -> None:
    walk = Walk(h=h)
    walk.set(column, 0.2 + 0.01 * np.sin(2.0 * np.pi * walk.time / PERIOD))
    metrics = walk.metrics()
    assert metrics[metric] == pytest.approx(0.01 / math.sqrt(2.0), rel=1e-9)
    others = [
        metrics[other] for other in ("height_rms", "roll_rms", "pitch_rms") if other != metric
    ]
    assert others == pytest.approx([0.0, 0.0], abs=1e-12)


def test_height_is_above_the_ground_that_rises() -> None:
    walk = Walk()
    walk.set("torso.position[3]", 0.13 + math.tan(0.1) * SPEED * walk.time)
    assert walk.metrics(terrain__kind=2, terrain__incline=0.1)["height_rms"] == pytest.approx(
        0.0, abs=1e-12
    )
    assert walk.metrics(terrain__kind=1, terrain__incline=0.1)["height_rms"] > 0.01


@pytest.mark.parametrize("heading", [0.0, 0.6, math.pi / 2.0, -0.6, 2.5])
def test_height_above_a_slope_is_the_same_wherever_on_it(heading: float) -> None:
    """The ground rises by tan(incline) along its heading and is at 0.4 m at the origin; the torso
    is 0.13 m above it.
    """
    x, y = np.array([0.0, 1.0, 0.0, -2.0]), np.array([0.0, 0.0, 1.0, 3.0])
    z = 0.4 + math.tan(0.2) * (x * math.cos(heading) + y * math.sin(heading)) + 0.13
    part = Recording(
        ("time", "torso.position[1]", "torso.position[2]", "torso.position[3]"),
        np.column_stack([x, x, y, z]),
    )
    ground = {
        "terrain.kind": 2.0,
        "terrain.incline": 0.2,
        "terrain.heading": heading,
        "terrain.height": 0.4,
    }
    assert body_height(part, ground) == pytest.approx([0.13] * 4)
    flat = {"terrain.kind": 1.0, "terrain.incline": 0.2, "terrain.height": 0.4}
    assert body_height(part, flat) == pytest.approx(z - 0.4)


def test_forces_are_in_body_weights_and_the_percentile_is_of_loaded_feet() -> None:
    walk = Walk()
    force = np.linspace(0.0, 1.0, len(walk.time))
    walk.set("LF.foot.normal_force", force * WEIGHT)
    # between two rows
    walk.set("LF.foot.peak_force", np.where(np.abs(walk.time - 5.0) < 0.3 * H, 1.7, 0.0) * WEIGHT)
    metrics = walk.metrics()
    assert metrics["peak_force"] == pytest.approx(1.7)
    # of what rises from 0.2 to 1
    assert metrics["force_p95"] == pytest.approx(0.2 + 0.95 * 0.8, abs=1e-3)


def test_a_peak_before_the_judged_cycles_does_not_count() -> None:
    """The peak in a row belongs to the time before the row: at 2 s, to the second cycle."""
    walk = Walk()
    walk.set("LF.foot.peak_force", np.where(walk.time < 2.0 + 0.3 * H, 3.0, 0.4) * WEIGHT)
    assert walk.metrics()["peak_force"] == pytest.approx(0.4)


def landings(
    walk: Walk, leg: str, times: list[float], rates: list[float], *, rising: float = 0.020
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
    walk = Walk()
    # the first two cycles do not count
    landings(walk, "LF", [k + 0.5 for k in range(10)], [1000.0, 1000.0, *range(1, 9)])
    assert walk.metrics()["loading_rate"] == pytest.approx(1.0 + 0.95 * 7.0)


def test_a_foot_that_bounces_lands_once_with_the_steeper_rise() -> None:
    walk = Walk()
    landings(walk, "LF", [2.5, 2.55, 3.5, 3.55], [40.0, 10.0, 20.0, 60.0])
    assert walk.metrics()["loading_rate"] == pytest.approx(np.percentile([40.0, 60.0], 95))


@pytest.mark.parametrize(("apart", "rate"), [(0.45, 60.0), (0.55, 59.0)])
def test_touch_downs_more_than_half_a_cycle_apart_are_two_landings(
    apart: float, rate: float
) -> None:
    """The metric is the 95th percentile of one landing of 60, or of one of 40 and one of 60."""
    walk = Walk()
    landings(walk, "LF", [4.0, 4.0 + apart], [40.0, 60.0])
    assert walk.metrics()["loading_rate"] == pytest.approx(rate)


def test_a_landing_that_begins_before_the_judged_cycles_does_not_count() -> None:
    walk = Walk()
    landings(walk, "LF", [1.99, 2.03, 4.5], [1000.0, 1000.0, 30.0])
    assert walk.metrics()["loading_rate"] == pytest.approx(30.0)


def test_torque_rms_is_over_all_joints_and_time() -> None:
    walk = Walk()
    walk.grow("LF.femur.torque_squared", 9.0)
    walk.set("LF.femur.torque", 100.0)  # at the rows' moments
    assert walk.metrics()["torque_rms"] == pytest.approx(3.0 / math.sqrt(18.0))


def test_heat_is_the_squared_torque_of_all_servos_per_metre_and_the_load_that_of_the_hottest() -> (
    None
):
    walk = Walk()
    walk.grow("LF.femur.torque_squared", 9.0)
    walk.grow("RR.tibia.torque_squared", 16.0)
    metrics = walk.metrics()
    assert metrics["heat"] == pytest.approx(25.0 / 0.08)
    assert metrics["servo_load_max"] == pytest.approx(4.0 / 1.2)  # of a rating of 1.2 N m


def test_cost_of_transport_counts_what_motors_drive_and_not_what_they_brake() -> None:
    walk = Walk()
    walk.grow("LF.femur.positive_work", 1.0)
    walk.grow("RF.femur.negative_work", 5.0)  # servos do not store it
    assert walk.metrics()["cost_of_transport"] == pytest.approx(1.0 / (0.08 * WEIGHT))


def test_electrical_cost_adds_the_copper_loss_by_the_motor_constant() -> None:
    """With 0.8 N m/sqrt(W) a torque of 2 N m costs 6.25 W while it stands still."""
    walk = Walk()
    walk.grow("LF.femur.positive_work", 1.0)
    walk.grow("RF.femur.torque_squared", 4.0)
    assert walk.metrics()["electrical_cost"] == pytest.approx(7.25 / (0.08 * WEIGHT))


def turning(rate: float = 0.3) -> Walk:
    """Returns a turn on the spot: the torso moves on a circle of 2 mm, and no walk is commanded."""
    walk = Walk(speed=0.0)
    walk.set("command.vx", 0.0)
    walk.set("command.yaw_rate", rate)
    walk.set("torso.yaw", np.angle(np.exp(1j * rate * walk.time)))
    walk.set("torso.position[1]", 0.002 * np.sin(1.7 * walk.time))
    return walk


def test_turning_on_the_spot_has_figures_per_radian() -> None:
    walk = turning()
    walk.grow("LF.foot.slip_distance", 0.01)
    walk.grow("LF.femur.positive_work", 2.0)
    walk.grow("LF.femur.torque_squared", 6.4)
    metrics = walk.metrics()
    assert metrics["slip_per_radian"] == pytest.approx(0.01 / 0.3)
    assert metrics["cost_per_radian"] == pytest.approx(2.0 / (0.3 * WEIGHT))
    assert metrics["heat_per_radian"] == pytest.approx(6.4 / 0.3)
    assert metrics["electrical_cost_per_radian"] == pytest.approx(12.0 / (0.3 * WEIGHT))
    assert metrics["yaw_drift_per_radian"] == pytest.approx(0.0, abs=1e-12)
    drift = 0.002 * abs(math.sin(17.0) - math.sin(3.4))
    assert metrics["path_error_per_radian"] == pytest.approx(drift / 2.4)
    assert all(math.isnan(metrics[name]) for name in (*PER_METRE, "slip_net_per_metre"))
    shown = shown_metrics({"kinematic": metrics}, net_slip=False)
    assert set(TWINS) <= set(shown)
    assert not set(PER_METRE) & set(shown)


def test_a_robot_that_walks_and_turns_has_figures_per_metre() -> None:
    walk = Walk()
    walk.set("command.yaw_rate", 0.3)
    walk.set("torso.yaw", 0.3 * walk.time)
    walk.grow("LF.foot.slip_distance", 0.01)
    metrics = walk.metrics()
    assert metrics["slip_per_metre"] == pytest.approx(0.01 / SPEED)
    assert all(math.isnan(metrics[name]) for name in TWINS)
    shown = shown_metrics({"kinematic": metrics}, net_slip=False)
    assert set(PER_METRE) <= set(shown)
    assert not {*TWINS, "slip_net_per_metre"} & set(shown)
    assert "slip_net_per_metre" in shown_metrics({"kinematic": metrics}, net_slip=True)


@pytest.mark.parametrize(("way", "walked"), [(0.0095, False), (0.0105, True)])
def test_a_robot_that_gets_no_further_than_a_centimetre_stands(way: float, walked: bool) -> None:
    walk = Walk(speed=way / JUDGED)
    assert math.isfinite(walk.metrics()["slip_per_metre"]) == walked


@pytest.mark.parametrize(("angle", "turned"), [(0.048, False), (0.052, True)])
def test_a_robot_that_turns_by_less_than_a_twentieth_of_a_radian_stands(
    angle: float, turned: bool
) -> None:
    walk = turning(angle / JUDGED)
    walk.set("torso.position[1]", 0.0)
    assert math.isfinite(walk.metrics()["slip_per_radian"]) == turned


def test_the_first_two_cycles_do_not_count() -> None:
    clean, dirty = Walk(), Walk()
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


def test_a_cycle_begun_does_not_count() -> None:
    walk = Walk()
    walk.set("torso.roll", np.where(walk.time > 9.0 + 1e-9, 0.5, 0.0))
    shorter = Recording(walk.names, walk.data[walk.time < 9.7])
    assert (
        compute_metrics(View(shorter, PARAMETERS, PERIOD), servo=SERVO, realtime_factor=1.0)[
            "roll_rms"
        ]
        == 0.0
    )


def test_a_standing_robot_has_no_figures_per_metre_and_json_says_null() -> None:
    metrics = Walk(speed=0.0).metrics()
    assert all(math.isnan(metrics[name]) for name in (*PER_METRE, *TWINS))
    assert metrics["height_rms"] == 0.0
    assert json.loads(to_json(metrics))["slip_per_metre"] is None


@pytest.mark.parametrize("cycles", [0, 1, 2])
def test_fewer_than_three_cycles_have_no_figures_but_those_of_the_run(cycles: int) -> None:
    metrics = Walk(cycles=cycles).metrics()
    assert metrics.pop("realtime_factor") == 42.0
    assert metrics.pop("energy_residual") == 0.0
    assert all(math.isnan(value) for value in metrics.values())


def test_a_command_between_two_rows_is_the_one_before_it() -> None:
    """Rows are 30 ms apart.

    At 2 s, between two of them, 0.2 m/s hold, although the next row has 0.08.
    """
    walk = Walk(h=0.03)
    speed = np.where(np.abs(walk.time - 1.98) < 0.01, 0.2, 0.08)
    walk.set("command.vx", speed)
    walk.set("torso.position[1]", held_integral(walk.time, speed))
    assert walk.metrics()["path_error"] == pytest.approx(0.0, abs=1e-9)


def test_a_sidestep_is_a_walk_and_no_turn_on_the_spot() -> None:
    walk = Walk(speed=0.0)
    walk.set("command.vx", 0.0)
    walk.set("command.vy", 0.05)
    walk.set("torso.position[2]", 0.05 * walk.time)
    walk.set("torso.yaw", 0.01 * walk.time)  # it drifts
    metrics = walk.metrics()
    assert metrics["yaw_drift"] == pytest.approx(0.2)
    assert math.isnan(metrics["yaw_drift_per_radian"])


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
def test_a_command_to_the_side_leads_to_the_left_of_the_heading(heading: float) -> None:
    walk = Walk()
    walk.set("torso.yaw", heading)
    walk.set("command.vx", 0.03)
    walk.set("command.vy", 0.04)
    end = commanded_path(walk.recording)[-1] - walk.recording.vector("torso.position")[0, :2]
    forward, left = 0.3, 0.4  # m in 10 s
    expected = [
        forward * math.cos(heading) - left * math.sin(heading),
        forward * math.sin(heading) + left * math.cos(heading),
    ]
    assert end == pytest.approx(expected)


def test_the_commanded_path_turns_with_the_command() -> None:
    walk = Walk()
    walk.set("command.vx", np.where(walk.time < 5.0 - H / 2, 0.1, 0.0))
    walk.set("command.vy", np.where(walk.time < 5.0 - H / 2, 0.0, 0.1))
    path = commanded_path(walk.recording)
    assert path[-1] == pytest.approx([0.5, 0.5])
    assert held_integral(np.array([0.0, 1.0, 4.0]), np.array([2.0, 5.0, 100.0])) == pytest.approx(
        [0.0, 2.0, 17.0]
    )


def test_the_energy_residual_is_the_largest_over_all_the_work_that_motors_did_and_took() -> None:
    walk = Walk()
    walk.grow("LF.femur.positive_work", 3.0)
    walk.grow("LF.femur.negative_work", 1.0)
    walk.set("energy.residual", np.where(np.abs(walk.time - 5.0) < 0.3 * H, -0.8, 0.2))
    assert walk.metrics()["energy_residual"] == pytest.approx(1.0 / 40.0)


def test_the_energy_residual_of_a_robot_at_rest_is_measured_by_a_lift_of_a_millimetre() -> None:
    walk = Walk(speed=0.0)
    walk.set("energy.residual", np.where(walk.time > 0.0, 1e-3 * WEIGHT, 0.0))
    assert walk.metrics()["energy_residual"] == pytest.approx(1.0)


def test_a_balance_warns_beyond_a_hundredth_of_the_work() -> None:
    assert Unbalanced.among([0.01, 0.0101, 0.02, math.nan]) == Unbalanced(2, 0.02)


def test_what_is_too_small_to_be_measured_is_stated_metric_by_metric() -> None:
    """The limits are a tenth of a millimetre and of a milliradian, and the resolution of force and
    torque sensing.
    """
    assert set(FLOORS) == set(METRICS)
    millis = (
        "height_rms",
        "roll_rms",
        "pitch_rms",
        "foot_error_stance",
        "foot_error_swing",
        "stability_margin",
        "slip_per_metre",
    )
    assert [FLOORS[name] for name in millis] == [1e-4] * 7
    assert [FLOORS[name] for name in ("path_error", "yaw_drift", "cost_of_transport")] == [1e-3] * 3
    assert [
        FLOORS[name]
        for name in ("peak_force", "force_p95", "torque_rms", "servo_load_max", "cone_use_p50")
    ] == [5e-3] * 5
    assert (FLOORS["loading_rate"], FLOORS["heat"], FLOORS["electrical_cost"]) == (5e-2, 0.5, 5e-3)


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
    walk = Walk()
    walk.grow("LF.femur.torque_squared", 9.0)
    stronger = replace(SERVO, torque_continuous=3.0, motor_constant=1.5)
    view = View(walk.recording, PARAMETERS, PERIOD)
    metrics = compute_metrics(view, servo=stronger, realtime_factor=1.0)
    assert metrics["servo_load_max"] == pytest.approx(1.0)
    assert metrics["electrical_cost"] == pytest.approx(4.0 / (0.08 * WEIGHT))
    assert CYCLES == 10
