"""Tests foot paths: at rest on the ground, smooth in the air, and ending at the stance
positions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import astuple
from typing import Any

import numpy as np
import pytest

from hexapod_cosim.controller import BodyCommand, CommandRamp, FootPaths, LegSolver, make_gait
from hexapod_cosim.controller.walk.foot_paths import PlannedFeet
from hexapod_cosim.controller.walk.swing import Twist, blend
from hexapod_cosim.models import GAITS, HexapodError, load_robot

PERIOD = 1e-3  # s
ROUND_OFF = 1e-12  # m/s
TWIST, STRAIGHT, REST = Twist(0.05 - 0.03j, 0.4), Twist(0.08 + 0j, 0.0), Twist(0j, 0.0)


class SteppedPaths:
    """The paths of a walk, computed section by section. `at` counts the steps since the section
    began.
    """

    def __init__(
        self, name: str = "tripod", *, period: float = PERIOD, touchdown_speed: float = 0.0
    ) -> None:
        robot = load_robot("athena")
        self.gait = make_gait(robot, name, touchdown_speed=touchdown_speed)
        self.paths = FootPaths(self.gait, LegSolver(robot), period=period)
        self.feet, self.at = self.paths.reset(), 0

    def step(self, twist: Twist, *, going: bool = True, afresh: bool = False) -> None:
        """Advances by one period; a new section begins where the last one ends, or afresh."""
        if afresh or self.at == 0 or not self.paths.clock.reach(self.at + 1):
            self.feet, self.at = self.paths.plan(self.feet, self.at, going=going, twist=twist), 0
        self.at += 1
        self.feet = self.paths.walk(self.at, twist, self.feet)

    @property
    def progress(self) -> np.ndarray:
        """Returns the part (6,) of the swing that swinging feet have completed, 0 for
        the others.
        """
        tau = (self.feet.phase - self.gait.duty) / (1.0 - self.gait.duty)
        return np.where(self.paths.clock.swinging, tau, 0.0)


def advance(
    walk: SteppedPaths, twist: Twist, steps: int, *, going: bool = True
) -> Iterator[SteppedPaths]:
    """Takes steps under a steady twist."""
    for k in range(steps):
        walk.step(twist, going=going, afresh=k == 0)
        yield walk


def record(steps: Iterable[SteppedPaths]) -> dict[str, np.ndarray]:
    """Records the feet of each step, `swinging` and `progress`."""
    rows = [
        {**walk.feet._asdict(), "swinging": walk.paths.clock.swinging, "progress": walk.progress}
        for walk in steps
    ]
    return {
        name: np.array([row[name] for row in rows])
        for name in (*PlannedFeet._fields, "swinging", "progress")
    }


def steady(walk: SteppedPaths, twist: Twist, steps: int) -> dict[str, np.ndarray]:
    """Returns the records of each step under a steady twist, after two cycles."""
    record(advance(walk, twist, round(2.0 * walk.gait.period / walk.paths.period)))
    return record(advance(walk, twist, steps))


def ground_velocity(log: dict[str, np.ndarray], twist: Twist) -> np.ndarray:
    """Returns the horizontal velocity of the feet over the ground [m/s]: dp/dt + v + i w p."""
    velocity: np.ndarray = log["velocity"] + twist[0] + 1j * twist[1] * log["plane"]
    return velocity


@pytest.mark.parametrize("name", GAITS)
@pytest.mark.parametrize("twist", [STRAIGHT, TWIST, Twist(0j, 0.5)])
def test_standing_feet_move_against_the_body_command_exactly(name: str, twist: Twist) -> None:
    log = steady(SteppedPaths(name), twist, 1000)
    over_ground = ground_velocity(log, twist)
    assert np.abs(over_ground[~log["swinging"]]).max() < ROUND_OFF
    assert np.abs(log["rise"][~log["swinging"]]).max() == 0.0


INWARD = np.array([-0.020, -0.025j, 0.020, -0.020, 0.025j, 0.020], dtype=np.complex128)  # m
TURNED = np.full(6, -4e-3)  # m


def narrowing_walk() -> SteppedPaths:
    """Returns a walk that is in the middle of the way to a narrow stance, in its amble."""
    walk = SteppedPaths("amble")
    walk.paths.inward, walk.paths.turned = INWARD, TURNED
    walk.paths.narrowing = 0.5
    return walk


def test_narrowed_steps_pass_the_middle_of_their_stance_at_the_narrow_position() -> None:
    walk = narrowing_walk()
    log = steady(walk, STRAIGHT, round(walk.gait.period / PERIOD))
    standing = ~log["swinging"]
    aims, step = walk.paths.home + 0.5 * INWARD, STRAIGHT.velocity.real * PERIOD
    for leg in range(6):
        way = log["plane"][standing[:, leg], leg]
        assert 0.5 * (way.real.max() + way.real.min()) == pytest.approx(aims[leg].real, abs=step)
        assert way.imag == pytest.approx(np.full(len(way), aims[leg].imag))
    assert np.abs(ground_velocity(log, STRAIGHT)[standing]).max() < ROUND_OFF
    assert log["rolled"] == pytest.approx(np.full_like(log["rolled"], 0.5 * TURNED[0]))


@pytest.mark.parametrize("twist", [STRAIGHT, TWIST])
def test_velocity_is_the_slope_of_position_and_nothing_jumps(twist: Twist) -> None:
    log = steady(SteppedPaths("ripple"), twist, 1000)
    largest = (
        30.0 * PERIOD
    )  # m/s; velocities change by 30 m/s2 in a step; a jump would be of order 0.1
    for position, velocity in (("plane", "velocity"), ("height", "rise")):
        slope = np.diff(log[position], axis=0) / PERIOD
        mean = 0.5 * (log[velocity][1:] + log[velocity][:-1])
        assert np.abs(slope - mean).max() < largest / 2.0
        assert np.abs(np.diff(log[velocity], axis=0)).max() < largest


@pytest.mark.parametrize("twist", [STRAIGHT, TWIST])
def test_feet_lift_off_and_touch_down_at_rest_on_the_ground(twist: Twist) -> None:
    log = steady(SteppedPaths(), twist, 1000)
    over_ground = ground_velocity(log, twist)
    ends = log["swinging"] & ((log["progress"] < 0.1) | (log["progress"] > 0.9))
    assert (
        np.abs(over_ground[ends]).max() < 1e-9
    )  # ds/dt (landing - p)/(1 - s) loses digits near s = 1
    edge = log["swinging"] & ((log["progress"] < 0.005) | (log["progress"] > 0.995))
    assert edge.any()
    assert np.abs(log["rise"][edge]).max() < 2e-3  # 192 H tau^2/T at tau = 0.005 is 0.4 mm/s


@pytest.mark.parametrize(
    ("progress", "moves"), [(0.09, False), (0.12, True), (0.88, True), (0.91, False)]
)
def test_a_foot_moves_along_the_ground_between_a_tenth_and_nine_tenths_of_its_swing(
    progress: float, moves: bool
) -> None:
    done, rate = blend(np.array([progress]))
    assert bool(rate[0] > 0.0) is moves
    assert bool(0.0 < done[0] < 1.0) is moves
    log = steady(SteppedPaths(), STRAIGHT, 1000)
    there = log["swinging"] & (np.abs(log["progress"] - progress) < 0.003)
    assert there.any()
    # at a progress of 0.12 the foot has 1 % of its largest speed, which is about 0.3 m/s
    assert bool(np.abs(ground_velocity(log, STRAIGHT)[there]).min() > 1e-4) is moves


def test_the_foot_rises_by_the_step_height() -> None:
    walk = SteppedPaths()
    log = steady(walk, STRAIGHT, 1000)
    np.testing.assert_allclose(
        (log["height"] - walk.paths.home_height).max(axis=0), walk.gait.step_height, rtol=1e-4
    )


@pytest.mark.parametrize(("progress", "follows"), [(0.4, True), (0.74, True), (0.77, False)])
def test_a_foot_follows_a_new_command_up_to_three_quarters_of_its_swing(
    progress: float, follows: bool
) -> None:
    walk = SteppedPaths()
    for _ in advance(walk, STRAIGHT, 2000):
        if progress <= walk.progress.max() < progress + 0.01:
            break
    leg = int(walk.progress.argmax())
    before = walk.feet.goal[leg]
    walk.step(TWIST, afresh=True)
    assert bool(abs(walk.feet.goal[leg] - before) > 1e-4) is follows


@pytest.mark.parametrize("name", GAITS)
def test_a_section_that_begins_afresh_under_the_same_twist_is_the_same_walk(name: str) -> None:
    """The walk differs by round-off only, because the feet's landing points are computed again from
    where the feet are.
    """
    whole, cut = SteppedPaths(name, period=0.007), SteppedPaths(name, period=0.007)
    for k in range(400):
        whole.step(TWIST)
        cut.step(TWIST, afresh=k % 7 == 0)
        np.testing.assert_allclose(cut.feet.plane, whole.feet.plane, atol=1e-12)
        np.testing.assert_allclose(cut.feet.velocity, whole.feet.velocity, atol=1e-9)


def test_a_ramp_is_smooth_and_ends_on_its_target_exactly() -> None:
    ramp, target = (
        CommandRamp(1.0, period=PERIOD),
        BodyCommand(vx=0.08, vy=-0.03, yaw_rate=0.2, height=0.01, roll=0.1, pitch=-0.1),
    )
    parts = []
    for aim, steps in ((target, 400), (BodyCommand(vx=-0.05), 300), (target, 1100)):
        ramp.aim(aim)
        parts.append([ramp.ahead(k) for k in range(1, steps + 1)])
        ramp.steps += steps
    values, rates = np.concatenate(parts).swapaxes(0, 1)
    slope = np.diff(values, axis=0) / PERIOD
    np.testing.assert_allclose(slope, 0.5 * (rates[1:] + rates[:-1]), atol=2e-6)
    assert tuple(values[-1]) == astuple(target)
    assert not rates[-1].any()
    assert ramp.settled()


@pytest.mark.parametrize("name", ["vx", "vy", "yaw_rate", "height", "roll", "pitch"])
@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("fast", "wrong type of an argument: got 'fast'"),
        (None, "wrong type of an argument: got 'nothing (None)'"),
        (1j, "wrong type of an argument: got 1j"),
        (float("nan"), "impossible body command: got nan"),
        (float("-inf"), "impossible body command: got -inf"),
    ],
)
def test_a_command_that_is_not_a_finite_number_is_refused(name: str, value: Any, said: str) -> None:
    with pytest.raises(HexapodError) as refused:
        BodyCommand(**{name: value})
    assert str(refused.value).startswith(f"{name}: {said}, expected a finite number")


def test_while_the_clock_is_held_no_foot_moves_over_the_ground_and_then_it_continues() -> None:
    robot = load_robot("athena")
    paths = FootPaths(make_gait(robot), LegSolver(robot), period=0.005)
    twist = Twist(0.05 + 0.01j, 0.1)
    feet, number = paths.plan(paths.reset(), 0, going=True, twist=twist), 0
    while paths.clock.reach(number + 1):
        number += 1
        feet = paths.walk(number, twist, feet)
    landing = paths.clock.landing(number)
    assert landing.sum() == 3
    feet = paths.hold(feet, number, twist=twist)
    ground, phase = paths._ground_of(feet), feet.phase
    for k in range(1, 41):
        assert paths.clock.reach(k)
        np.testing.assert_array_equal(paths.clock.landing(k), landing)
        before, feet = feet, paths.walk(k, twist, feet)
        np.testing.assert_allclose(paths._ground_of(feet), ground, atol=1e-15)
        np.testing.assert_array_equal(feet.phase, phase)
        assert not feet.rise.any()
        np.testing.assert_allclose((feet.plane - before.plane) / 0.005, feet.velocity, atol=1e-4)
    feet = paths.plan(feet, 40, going=True, twist=twist)
    np.testing.assert_array_equal(feet.phase, phase)
    assert not (paths.clock.swinging & landing).any()
    assert not paths.clock.awaited.any()


def test_a_foot_that_has_met_the_ground_stays_there() -> None:
    robot = load_robot("athena")
    paths = FootPaths(make_gait(robot), LegSolver(robot), period=0.005)
    twist = Twist(0.08 + 0j, 0.0)
    feet = paths.plan(paths.reset(), 0, going=True, twist=twist)
    for number in range(1, 71):
        feet = paths.walk(number, twist, feet)
    leg = int(np.flatnonzero(paths.clock.swinging)[0])
    paths.met = np.arange(6) == leg
    place = paths._ground_of(feet)[leg]
    for number in range(71, 91):
        feet = paths.walk(number, twist, feet)
        assert abs(paths._ground_of(feet)[leg] - place) < 1e-15
        assert feet.velocity[leg] == pytest.approx(-0.08)
