"""Foot paths: at rest on the ground, smooth through the air, and home again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import astuple, fields, replace

import numpy as np
import pytest

from hexapod_cosim.controller import BodyCommand, CommandRamp, FootPaths, LegSolver, make_gait
from hexapod_cosim.controller.trajectory import Steps
from hexapod_cosim.models import GAITS, HexapodError, load_robot

PERIOD = 1e-3  # s
ROUND_OFF = 1e-12  # m/s
TWIST = (0.05 - 0.03j, 0.4)
STRAIGHT = (0.08 + 0j, 0.0)
REST = (0j, 0.0)

Twist = tuple[complex, float]  # vx + i vy [m/s], yaw rate [rad/s]


def make_paths(
    name: str = "tripod", *, period: float = PERIOD, touchdown_speed: float = 0.0
) -> FootPaths:
    robot = load_robot("athena")
    gait = make_gait(robot, name, touchdown_speed=touchdown_speed)
    return FootPaths(gait, LegSolver(robot).forward(robot.stance), period=period)


def advance(
    paths: FootPaths, twist: Twist, steps: int, *, going: bool = True, at_once: int = 64
) -> Iterator[FootPaths]:
    """Steps under a steady twist from now on, so many planned at once."""
    for k in range(steps):
        if k == 0 or not paths.left:
            paths.plan(np.full(at_once + 1, twist[0]), np.full(at_once + 1, twist[1]), going=going)
        paths.advance()
        yield paths


def record(steps: Iterable[FootPaths]) -> dict[str, np.ndarray]:
    """What the paths were in each step."""
    log: dict[str, list[np.ndarray]] = {item.name: [] for item in fields(Steps)}
    for paths in steps:
        for key, rows in log.items():
            rows.append(getattr(paths.steps, key)[paths.at].copy())
    return {key: np.array(rows) for key, rows in log.items()}


def walk(paths: FootPaths, twist: Twist, steps: int) -> dict[str, np.ndarray]:
    """Records of each step under a steady twist, after two cycles to get going."""
    record(advance(paths, twist, round(2.0 * paths.gait.period / paths.period)))
    return record(advance(paths, twist, steps))


def ground_velocity(log: dict[str, np.ndarray], twist: Twist) -> np.ndarray:
    """Horizontal velocity of the feet over the ground [m/s]: dp/dt + v + i w p."""
    velocity: np.ndarray = log["plane_velocity"] + twist[0] + 1j * twist[1] * log["plane"]
    return velocity


@pytest.mark.parametrize("name", GAITS)
@pytest.mark.parametrize("twist", [STRAIGHT, TWIST, (0j, 0.5)])
def test_standing_feet_move_against_the_body_command_exactly(name: str, twist: Twist) -> None:
    log = walk(make_paths(name), twist, 1000)
    over_ground = ground_velocity(log, twist)
    assert np.abs(over_ground[~log["swinging"]]).max() < ROUND_OFF
    assert np.abs(log["rise"][~log["swinging"]]).max() == 0.0


@pytest.mark.parametrize("twist", [STRAIGHT, TWIST])
def test_velocity_is_the_slope_of_position_and_nothing_jumps(twist: Twist) -> None:
    log = walk(make_paths("ripple"), twist, 1000)
    largest = (
        30.0 * PERIOD
    )  # m/s    a step's change of velocity at 30 m/s2; a jump of velocity would be of order 0.1
    for position, velocity in (("plane", "plane_velocity"), ("height", "rise")):
        slope = np.diff(log[position], axis=0) / PERIOD
        mean = 0.5 * (log[velocity][1:] + log[velocity][:-1])
        assert np.abs(slope - mean).max() < largest / 2.0
        assert np.abs(np.diff(log[velocity], axis=0)).max() < largest


@pytest.mark.parametrize("twist", [STRAIGHT, TWIST])
def test_feet_lift_off_and_touch_down_at_rest_on_the_ground(twist: Twist) -> None:
    log = walk(make_paths(), twist, 1000)
    over_ground = ground_velocity(log, twist)
    ends = log["swinging"] & ((log["progress"] < 0.1) | (log["progress"] > 0.9))
    assert (
        np.abs(over_ground[ends]).max() < 1e-9
    )  # ds/dt (landing - p)/(1 - s) loses digits as s nears 1
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
    np.testing.assert_allclose(
        (log["height"] - paths.home_height).max(axis=0), paths.gait.step_height, rtol=1e-4
    )


@pytest.mark.parametrize("twist", [STRAIGHT, TWIST])
def test_the_middle_of_a_stance_is_the_stance_position(twist: Twist) -> None:
    paths = make_paths("wave")
    log = record(advance(paths, twist, 5000))
    middle = (np.abs(log["phase"] - 0.5 * paths.gait.duty) < 0.6 * PERIOD) & ~log["swinging"]
    middle[:2000] = False
    assert middle.any(axis=0).all()
    assert np.abs(log["plane"] - paths.home)[middle].max() < 1.2 * PERIOD * 0.2


def test_a_swing_that_ends_within_a_period_still_lands_on_its_point() -> None:
    coarse, fine = make_paths(period=0.007), make_paths(period=0.001)
    slow, quick = record(advance(coarse, TWIST, 300)), record(advance(fine, TWIST, 2100))
    standing = ~slow["swinging"][-1]
    np.testing.assert_allclose(slow["plane"][-1][standing], quick["plane"][-1][standing], atol=1e-9)


@pytest.mark.parametrize(("progress", "follows"), [(0.4, True), (0.74, True), (0.77, False)])
def test_a_foot_follows_a_new_command_up_to_three_quarters_of_its_swing(
    progress: float, follows: bool
) -> None:
    paths = make_paths()
    for _ in advance(paths, STRAIGHT, 2000):
        if (
            paths.steps.progress[paths.at].max() >= progress
            and paths.steps.progress[paths.at].max() < progress + 0.01
        ):
            break
    leg = int(paths.steps.progress[paths.at].argmax())
    before = paths.steps.goal[paths.at, leg]
    next(advance(paths, TWIST, 1))
    assert bool(abs(paths.steps.goal[paths.at, leg] - before) > 1e-4) is follows


@pytest.mark.parametrize(("away", "steps"), [(0.9e-9, False), (1.1e-9, True)])
def test_a_foot_within_a_nanometre_of_its_stance_position_stays_where_it_is(
    away: float, steps: bool
) -> None:
    paths = make_paths()
    for _ in advance(paths, STRAIGHT, 1):
        pass
    paths.steps.plane[paths.at], paths.steps.goal[paths.at] = paths.home + away, paths.home + away
    paths.steps = replace(paths.steps, swinging=np.zeros_like(paths.steps.swinging))
    next(advance(paths, REST, 1, going=False))
    assert paths.walking is steps


@pytest.mark.parametrize("name", GAITS)
def test_steps_do_not_depend_on_how_many_are_planned_at_once(name: str) -> None:
    def planned(at_once: int) -> list[np.ndarray]:
        paths = make_paths(name, period=0.007)
        found: list[np.ndarray] = []
        for twist, going, steps in (
            (STRAIGHT, True, 150),
            (TWIST, True, 333),
            (REST, False, 700),
            (TWIST, True, 100),
        ):
            found += record(advance(paths, twist, steps, going=going, at_once=at_once)).values()
        return found

    one_by_one = planned(1)
    for at_once in (7, 500):
        for mine, other in zip(planned(at_once), one_by_one, strict=True):
            np.testing.assert_array_equal(mine, other)


def test_a_ramp_is_smooth_and_ends_on_its_target_exactly() -> None:
    ramp, target = (
        CommandRamp(1.0, period=PERIOD),
        BodyCommand(vx=0.08, vy=-0.03, yaw_rate=0.2, height=0.01, roll=0.1, pitch=-0.1),
    )
    parts = []
    for aim, steps in ((target, 400), (BodyCommand(vx=-0.05), 300), (target, 1100)):
        ramp.aim(aim)
        parts.append(np.array(ramp.ahead(steps)))
        ramp.steps += steps
    values, rates = np.concatenate([part[:, 1:] for part in parts], axis=1)
    slope = np.diff(values, axis=0) / PERIOD
    np.testing.assert_allclose(slope, 0.5 * (rates[1:] + rates[:-1]), atol=2e-6)
    assert tuple(values[-1]) == astuple(target)
    assert not rates[-1].any()
    assert ramp.settled


@pytest.mark.parametrize(
    ("duration", "period"), [(1.0, 0.005), (1.2, 0.005), (3.000000000000001, 0.005), (0.7, 0.003)]
)
def test_a_ramp_takes_the_least_number_of_periods_that_fill_its_duration(
    duration: float, period: float
) -> None:
    ramp = CommandRamp(duration, period=period)
    ramp.aim(BodyCommand(vx=0.1))
    assert (ramp.remaining - 1) * period < duration <= ramp.remaining * period
    ramp.steps += ramp.remaining
    assert ramp.settled


def test_repeating_a_command_does_not_restart_the_ramp() -> None:
    once, often = CommandRamp(1.0, period=PERIOD), CommandRamp(1.0, period=PERIOD)
    once.aim(BodyCommand(vx=0.1))
    for _ in range(500):
        often.aim(BodyCommand(vx=0.1))
        often.steps += 1
        once.steps += 1
    np.testing.assert_array_equal(once.ahead(100), often.ahead(100))


def test_a_command_that_is_not_a_number_is_refused() -> None:
    with pytest.raises(HexapodError, match="impossible body command"):
        CommandRamp(1.0, period=PERIOD).aim(BodyCommand(vy=float("nan")))


def test_the_clock_stays_stopped_without_a_command() -> None:
    paths = make_paths()
    log = record(advance(paths, REST, 100, going=False))
    np.testing.assert_array_equal(log["plane"], np.tile(paths.home, (100, 1)))
    assert not paths.walking
