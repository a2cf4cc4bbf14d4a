"""Tests gaits: which legs stand at which time, and whether they carry the robot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hexapod_cosim.controller import PATTERNS, LegSolver, make_gait
from hexapod_cosim.models import GAITS, HexapodError, load_robot

CLOCKS = np.linspace(0.0, 1.0, 240, endpoint=False) + 1e-7  # cycles, away from the switching points
# order: front right, mid right, rear right, rear left, mid left, front left; multiplier x offset /
# (stance + swing)
OPENSHC = {
    "tripod": np.array([0, 1, 0, 1, 0, 1]) * 2 / 4,
    "ripple": np.array([2, 0, 4, 1, 3, 5]) * 1 / 6,
    "wave": np.array([2, 3, 4, 1, 0, 5]) * 2 / 12,
    "amble": np.array([1, 2, 0, 1, 2, 0]) * 1 / 3,
}


def margin(feet: np.ndarray) -> float:
    """Returns the distance [m] from the origin to the edge of the convex hull of feet (n, 2),
    negative outside.
    """
    if len(feet) < 3:
        return -np.inf
    order = feet[np.argsort(np.arctan2(*(feet - feet.mean(axis=0)).T[::-1]))]
    hull = [
        p for k, p in enumerate(order) if _turn(order[k - 1], p, order[(k + 1) % len(order)]) > 0.0
    ]
    edges = np.roll(hull, -1, axis=0) - hull
    moments = edges[:, 1] * np.array(hull)[:, 0] - edges[:, 0] * np.array(hull)[:, 1]
    return float((moments / np.linalg.norm(edges, axis=1)).min())


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    (ax, ay), (bx, by) = b - a, c - b
    return float(ax * by - ay * bx)


@pytest.mark.parametrize("name", GAITS)
def test_offsets_are_openshcs_in_our_order_of_legs(name: str) -> None:
    rf, rm, rr, lr, lm, lf = OPENSHC[name]
    np.testing.assert_allclose(PATTERNS[name].offsets, [lf, lm, lr, rf, rm, rr], atol=1e-15)


@pytest.mark.parametrize("duty", [0.3, 0.5, 0.77, None])
@pytest.mark.parametrize("name", GAITS)
def test_each_leg_stands_for_the_duty_factor(name: str, duty: float | None) -> None:
    gait = make_gait(load_robot("athena"), name, duty=duty)
    stands = np.array([gait.stance(clock) for clock in CLOCKS]).mean(axis=0)
    np.testing.assert_allclose(stands, gait.duty, atol=1.5 / len(CLOCKS))


@pytest.mark.parametrize(
    ("name", "legs"), [("tripod", 3), ("ripple", 4), ("wave", 5), ("amble", 4)]
)
def test_the_natural_duty_factor_keeps_the_number_of_standing_legs(name: str, legs: int) -> None:
    gait = make_gait(load_robot("athena"), name)
    assert {int(gait.stance(clock).sum()) for clock in CLOCKS} == {legs}


@pytest.mark.parametrize("robot_name", ["athena", "phantomx_mk4"])
@pytest.mark.parametrize("name", GAITS)
def test_the_standing_feet_carry_the_robot_at_all_times(name: str, robot_name: str) -> None:
    robot = load_robot(robot_name)
    feet = LegSolver(robot).forward(robot.stance)[:, :2]
    gait = make_gait(robot, name)
    assert min(margin(feet[gait.stance(clock)]) for clock in CLOCKS) > 0.03


def test_another_gait_than_the_robots_gets_its_natural_duty_factor_and_the_robots_swing_time() -> (
    None
):
    robot = load_robot("athena")
    assert (make_gait(robot).duty, make_gait(robot).period) == (robot.gait.duty, robot.gait.period)
    wave = make_gait(robot, "wave")
    assert wave.duty == pytest.approx(10.0 / 12.0)
    assert wave.period * (1.0 - wave.duty) == pytest.approx(
        robot.gait.period * (1.0 - robot.gait.duty)
    )
    assert make_gait(robot, "wave", period=0.7).period == 0.7


def test_an_unknown_gait_names_the_nearest() -> None:
    with pytest.raises(HexapodError, match="did you mean 'tripod'"):
        make_gait(load_robot("athena"), "tripd")


@pytest.mark.parametrize(
    "change",
    [
        {"duty": 0.0},
        {"duty": 1.0},
        {"period": 0.0},
        {"step_height": -0.01},
        {"touchdown_speed": -0.1},
    ],
)
def test_an_impossible_gait_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(HexapodError, match="impossible gait"):
        make_gait(load_robot("athena"), **change)
