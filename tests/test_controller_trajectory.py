"""Foot paths: at rest on the ground, smooth through the air, and home again."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest

from hexapod_cosim.controller import BodyCommand, CommandRamp, FootPaths, LegSolver, make_gait
from hexapod_cosim.models import GAITS, HexapodError, load_robot

PERIOD = 1e-3  # s
ROUND_OFF = 1e-12  # m/s
TWIST = (0.05 - 0.03j, 0.4)
STRAIGHT = (0.08 + 0j, 0.0)


def make_paths(name: str = "tripod", *, period: float = PERIOD, touchdown_speed: float = 0.0) -> FootPaths:
    robot = load_robot("athena")
    gait = make_gait(robot, name, touchdown_speed=touchdown_speed)
    return FootPaths(gait, LegSolver(robot).forward(robot.stance), period=period)


def walk(paths: FootPaths, twist: tuple[complex, float], steps: int) -> dict[str, np.ndarray]:
    """Records of each step under a steady twist, after two cycles to get going."""
    for _ in range(round(2.0 * paths.gait.period / paths.period)):
        paths.advance(twist, twist, going=True)
    keys = ("plane", "height", "plane_velocity", "rise", "swinging", "progress")
    log: dict[str, list[np.ndarray]] = {key: [] for key in keys}
    for _ in range(steps):
        paths.advance(twist, twist, going=True)
        for key in keys:
            log[key].append(getattr(paths, key).copy())
    return {key: np.array(values) for key, values in log.items()}


def ground_velocity(log: dict[str, np.ndarray], twist: tuple[complex, float]) -> np.ndarray:
    """Horizontal velocity of the feet over the ground [m/s]: dp/dt + v + i w p."""
    velocity: np.ndarray = log["plane_velocity"] + twist[0] + 1j * twist[1] * log["plane"]
    return velocity


@pytest.mark.parametrize("name", GAITS)
@pytest.mark.parametrize("twist", [STRAIGHT, TWIST, (0j, 0.5)])
def test_standing_feet_move_against_the_body_command_exactly(name: str, twist: tuple[complex, float]) -> None:
    log = walk(make_paths(name), twist, 1000)
    over_ground = ground_velocity(log, twist)
    assert np.abs(over_ground[~log["swinging"]]).max() < ROUND_OFF
    assert np.abs(log["rise"][~log["swinging"]]).max() == 0.0


@pytest.mark.parametrize("twist", [STRAIGHT, TWIST])
def test_velocity_is_the_slope_of_position_and_nothing_jumps(twist: tuple[complex, float]) -> None:
    log = walk(make_paths("ripple"), twist, 1000)
    largest = 30.0 * PERIOD  # m/s    a step's change of velocity at 30 m/s2; a jump of velocity would be of order 0.1
    for position, velocity in (("plane", "plane_velocity"), ("height", "rise")):
        slope = np.diff(log[position], axis=0) / PERIOD
        mean = 0.5 * (log[velocity][1:] + log[velocity][:-1])
        assert np.abs(slope - mean).max() < largest / 2.0
        assert np.abs(np.diff(log[velocity], axis=0)).max() < largest


@pytest.mark.parametrize("twist", [STRAIGHT, TWIST])
def test_feet_lift_off_and_touch_down_at_rest_on_the_ground(twist: tuple[complex, float]) -> None:
    log = walk(make_paths(), twist, 1000)
    over_ground = ground_velocity(log, twist)
    ends = log["swinging"] & ((log["progress"] < 0.1) | (log["progress"] > 0.9))
    assert np.abs(over_ground[ends]).max() < 1e-9  # ds/dt (landing - p)/(1 - s) loses digits as s nears 1
    edge = log["swinging"] & ((log["progress"] < 0.005) | (log["progress"] > 0.995))
    assert edge.any()
    assert np.abs(log["rise"][edge]).max() < 2e-3  # 192 H tau^2 / T at tau = 0.005: 0.4 mm/s


def test_the_optional_touch_down_speed_is_reached() -> None:
    log = walk(make_paths(touchdown_speed=0.05), STRAIGHT, 1000)
    last = log["progress"] > 0.9975
    assert last.any()
    np.testing.assert_allclose(log["rise"][last], -0.05, atol=2e-3)


def test_the_foot_rises_by_the_step_height() -> None:
    paths = make_paths()
    log = walk(paths, STRAIGHT, 1000)
    np.testing.assert_allclose((log["height"] - paths.home_height).max(axis=0), paths.gait.step_height, rtol=1e-4)


@pytest.mark.parametrize("twist", [STRAIGHT, TWIST])
def test_the_middle_of_a_stance_is_the_stance_position(twist: tuple[complex, float]) -> None:
    paths = make_paths("wave")
    half = 0.5 * paths.gait.duty
    for _ in range(3000):
        paths.advance(twist, twist, going=True)
        middle = (np.abs(paths.phase - half) < 0.6 * PERIOD) & ~paths.swinging
        if paths._steps > 2000 and middle.any():
            assert np.abs(paths.plane - paths.home)[middle].max() < 1.2 * PERIOD * 0.2


def test_a_swing_that_ends_within_a_period_still_lands_on_its_point() -> None:
    coarse, fine = make_paths(period=0.007), make_paths(period=0.001)
    for _ in range(300):
        coarse.advance(TWIST, TWIST, going=True)
    for _ in range(2100):
        fine.advance(TWIST, TWIST, going=True)
    standing = ~coarse.swinging
    np.testing.assert_allclose(coarse.plane[standing], fine.plane[standing], atol=1e-9)


def test_a_ramp_is_smooth_and_ends_on_its_target_exactly() -> None:
    ramp, target = CommandRamp(1.0), BodyCommand(vx=0.08, vy=-0.03, yaw_rate=0.2, height=0.01, roll=0.1, pitch=-0.1)
    values, rates = [ramp.value.copy()], [ramp.rate.copy()]
    ramp.aim(target)
    for k in range(1500):
        if k == 400:
            ramp.aim(BodyCommand(vx=-0.05))
        if k == 700:
            ramp.aim(target)
        ramp.advance(PERIOD)
        values.append(ramp.value.copy())
        rates.append(ramp.rate.copy())
    slope = np.diff(values, axis=0) / PERIOD
    np.testing.assert_allclose(slope[:-10], 0.5 * (np.array(rates)[1:] + np.array(rates)[:-1])[:-10], atol=2e-6)
    for _ in range(300):
        ramp.advance(PERIOD)
    assert tuple(ramp.value) == astuple(target)
    assert not ramp.rate.any()


def test_repeating_a_command_does_not_restart_the_ramp() -> None:
    once, often = CommandRamp(1.0), CommandRamp(1.0)
    once.aim(BodyCommand(vx=0.1))
    for _ in range(500):
        often.aim(BodyCommand(vx=0.1))
        often.advance(PERIOD)
        once.advance(PERIOD)
    np.testing.assert_array_equal(once.value, often.value)


def test_a_command_that_is_not_a_number_is_refused() -> None:
    with pytest.raises(HexapodError, match="impossible body command"):
        CommandRamp(1.0).aim(BodyCommand(vy=float("nan")))


def test_the_clock_stays_stopped_without_a_command() -> None:
    paths = make_paths()
    for _ in range(100):
        paths.advance((0j, 0.0), (0j, 0.0), going=False)
    np.testing.assert_array_equal(paths.plane, paths.home)
    assert not paths.walking
