"""Metrics of feet, path, torso and turning on synthetic walks for which they are known."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from walks import PERIOD, SPEED, WEIGHT, H, SyntheticRun

from hexapod_cosim.cosim.common.files import to_json
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.metric_table import shown_metrics
from hexapod_cosim.cosim.results.support import body_height
from hexapod_cosim.cosim.results.window import commanded_path, hold_integral

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


def test_feet_are_compared_with_their_plan_in_the_torsos_frame() -> None:
    """The torso is turned, tilted and away from the origin.

    Each foot is 3 mm off its plan in stance, one is 6 mm off in swing.
    """
    walk = SyntheticRun(planned=True)
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
    walk, incline, heading = SyntheticRun(planned=True), 0.2, 0.7
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


def test_a_walk_ten_percent_short_has_a_path_error_of_a_ninth() -> None:
    assert SyntheticRun(speed=0.9 * SPEED).metrics()["path_error"] == pytest.approx(0.1 / 0.9)
    assert SyntheticRun().metrics()["path_error"] == pytest.approx(0.0, abs=1e-12)


def test_the_commanded_path_sets_out_along_the_mean_heading_of_a_cycle() -> None:
    """A torso that swings by 0.1 rad about its way walks along that way.

    Its yaw in the first row does not matter.
    """
    walk = SyntheticRun()
    walk.set("torso.yaw", 0.1 * np.cos(2.0 * np.pi * walk.time / PERIOD + 0.7))
    assert walk.metrics()["path_error"] == pytest.approx(0.0, abs=1e-6)


def test_a_commanded_circle_is_followed_without_error() -> None:
    rate = 0.3
    walk = SyntheticRun()
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
    walk = SyntheticRun()
    walk.set("torso.yaw", -0.01 * walk.time)
    assert walk.metrics()["yaw_drift"] == pytest.approx(0.01 / SPEED)


def test_the_torso_bobbing_within_a_cycle_walks_no_metre() -> None:
    walk = SyntheticRun()
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
    walk = SyntheticRun(h=h)
    walk.set(column, 0.2 + 0.01 * np.sin(2.0 * np.pi * walk.time / PERIOD))
    metrics = walk.metrics()
    assert metrics[metric] == pytest.approx(0.01 / math.sqrt(2.0), rel=1e-9)
    others = [
        metrics[other] for other in ("height_rms", "roll_rms", "pitch_rms") if other != metric
    ]
    assert others == pytest.approx([0.0, 0.0], abs=1e-12)


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


def turning(rate: float = 0.3) -> SyntheticRun:
    """Returns a turn on the spot: the torso moves on a circle of 2 mm, and no walk is commanded."""
    walk = SyntheticRun(speed=0.0)
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
    walk = SyntheticRun()
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


def test_a_standing_robot_has_no_figures_per_metre_and_json_says_null() -> None:
    metrics = SyntheticRun(speed=0.0).metrics()
    assert all(math.isnan(metrics[name]) for name in (*PER_METRE, *TWINS))
    assert metrics["height_rms"] == 0.0
    assert json.loads(to_json(metrics))["slip_per_metre"] is None


def test_a_sidestep_is_a_walk_and_no_turn_on_the_spot() -> None:
    walk = SyntheticRun(speed=0.0)
    walk.set("command.vx", 0.0)
    walk.set("command.vy", 0.05)
    walk.set("torso.position[2]", 0.05 * walk.time)
    walk.set("torso.yaw", 0.01 * walk.time)  # it drifts
    metrics = walk.metrics()
    assert metrics["yaw_drift"] == pytest.approx(0.2)
    assert math.isnan(metrics["yaw_drift_per_radian"])


def test_the_commanded_path_turns_with_the_command() -> None:
    walk = SyntheticRun()
    walk.set("command.vx", np.where(walk.time < 5.0 - H / 2, 0.1, 0.0))
    walk.set("command.vy", np.where(walk.time < 5.0 - H / 2, 0.0, 0.1))
    path = commanded_path(walk.recording)
    assert path[-1] == pytest.approx([0.5, 0.5])
    assert hold_integral(np.array([0.0, 1.0, 4.0]), np.array([2.0, 5.0, 100.0])) == pytest.approx(
        [0.0, 2.0, 17.0]
    )
