"""Tests the detection of touch-down and lift-off, at what height a foot is expected to meet the
ground, and ground that is met early or late.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from gains import PERIOD
from standing import ROBOT, WEIGHT, Laws, make_laws, plan, squeezing

from hexapod_cosim.controller import Parts
from hexapod_cosim.controller.sense.contact_detection import ContactDetector
from hexapod_cosim.controller.sense.touchdown import Landings, Touchdown
from hexapod_cosim.controller.sense.trust import SensorWatch, replaced

LOAD, CYCLE, SAMPLE = 50.0, 1.0, 0.005  # N, s, s
NO_LEGS, ALL_LEGS = np.zeros(6, dtype=bool), np.ones(6, dtype=bool)


def only(*legs: int) -> np.ndarray:
    return np.isin(np.arange(6), legs)


def but(*legs: int) -> np.ndarray:
    return ~only(*legs)


def test_a_foot_touches_down_above_2_percent_of_the_weight_and_lifts_off_below_half_a_percent() -> (
    None
):
    detector = ContactDetector(LOAD)
    forces = [0.0, 0.6, 0.99, 1.01, 0.6, 0.26, 0.24, 0.6, 0.99, 1.01]  # N
    found = [bool(detector.step(np.full(6, force))[2]) for force in forces]
    assert found == [False, False, False, True, True, True, False, False, False, True]


def until_doubted(watch: SensorWatch, leg: int, **seen: np.ndarray | float) -> int:
    """Returns the time [s] after which a sensor is doubted; no other sensor may ever be doubted."""
    for count in range(1, 1000):
        doubted = watch.update(**seen)  # type: ignore[arg-type]
        assert not any(doubted[other] for other in range(6) if other != leg)
        if doubted[leg]:
            return count
    return 0


def test_a_dead_sensor_of_a_foot_that_carries_is_doubted_after_a_tenth_of_a_second() -> None:
    watch = SensorWatch(LOAD, cycle=CYCLE, period=SAMPLE)
    count = until_doubted(watch, 2, contact=but(2), total=40.0, standing=ALL_LEGS, high=NO_LEGS)
    assert count in {20, 21}  # times are sums of periods


def test_a_stuck_sensor_of_a_foot_in_mid_swing_is_doubted_after_60_milliseconds() -> None:
    watch = SensorWatch(LOAD, cycle=CYCLE, period=SAMPLE)
    count = until_doubted(watch, 2, contact=ALL_LEGS, total=LOAD, standing=but(2), high=only(2))
    assert count in {12, 13}


def test_a_doubted_foot_touches_down_above_10_percent_and_lifts_off_below_3_percent() -> None:
    watch, contact, found = SensorWatch(LOAD, cycle=CYCLE, period=SAMPLE), NO_LEGS, []
    for force in (0.0, 4.9, 5.1, 1.6, 1.4, 4.9):  # N
        contact = watch.found(np.full(6, force), contact)
        found.append(bool(contact[2]))
    assert found == [False, False, True, True, False, False]


def test_doubted_feet_bear_what_the_others_leave_in_the_shares_of_the_plan() -> None:
    planned = np.array([[1.0, 2.0, load] for load in (10.0, 30.0, 10.0, 0.0, 0.0, 0.0)])
    force = np.array([[0.5, 0.0, load] for load in (12.0, 99.0, 6.0, 7.0, 0.0, 5.0)])
    one = replaced(force, planned, but(5), only(1))  # foot 5 reports no contact
    assert one[1].tolist() == pytest.approx([1.0, 2.0, 25.0])
    assert one[[0, 2, 3, 4, 5]].tolist() == force[[0, 2, 3, 4, 5]].tolist()
    assert replaced(force, planned, ALL_LEGS, only(1, 2))[:, 2] == pytest.approx(
        [12.0, 19.5, 6.5, 7.0, 0.0, 5.0]
    )
    assert replaced(force, planned, ALL_LEGS, only(3, 4))[3, 2] == 0.0  # the others bear more


def test_a_missing_foothold_whose_weight_the_others_carry_is_not_a_dead_sensor() -> None:
    watch = SensorWatch(LOAD, cycle=CYCLE, period=SAMPLE)
    for _ in range(1000):
        assert not any(
            watch.update(but(2), 46.1, ALL_LEGS, NO_LEGS)
        )  # N; 92 % of the weight are 46
    assert not watch.busy()
    assert until_doubted(watch, 2, contact=but(2), total=45.9, standing=ALL_LEGS, high=NO_LEGS)


def test_a_foot_that_need_not_carry_or_is_not_high_contradicts_nothing() -> None:
    watch = SensorWatch(LOAD, cycle=CYCLE, period=SAMPLE)
    for _ in range(200):
        assert not watch.update(NO_LEGS, 0.0, NO_LEGS, ALL_LEGS).any()
        assert not watch.update(ALL_LEGS, LOAD, NO_LEGS, NO_LEGS).any()
    assert not watch.busy()


def test_a_sensor_is_trusted_again_after_one_and_a_half_cycles_without_contradiction() -> None:
    watch = SensorWatch(LOAD, cycle=CYCLE, period=SAMPLE)
    until_doubted(watch, 2, contact=but(2), total=0.5 * LOAD, standing=ALL_LEGS, high=NO_LEGS)
    count = 0
    while watch.update(ALL_LEGS, LOAD, ALL_LEGS, NO_LEGS)[2]:
        assert watch.busy()
        count += 1
    assert abs(count - 300) <= 2
    assert not watch.busy()


# Tests ground that is met early or late: a foot is not pressed into early ground, and reaches down
# for late ground.

STEP = 0.005  # s
YES, NO, STILL = np.ones(6, dtype=bool), np.zeros(6, dtype=bool), np.zeros(6)


def only_leg(leg: int) -> np.ndarray:
    return np.asarray(np.arange(6) == leg)


def test_a_foot_that_meets_the_ground_early_keeps_the_height_at_which_it_touched() -> None:
    down, height, total = Touchdown(period=STEP), 0.02, 0.0
    heights = []
    for _ in range(15):
        fall = 0.001
        height -= fall
        down.step(only_leg(2), np.full(6, fall), YES, NO, NO, NO)
        total += fall
        heights.append(height + down.offset[2])
    np.testing.assert_allclose(heights, 0.02, atol=1e-12)
    assert down.offset[2] == pytest.approx(total)
    assert [down.offset[leg] for leg in (0, 1, 3, 4, 5)] == [0.0] * 5


def test_it_keeps_it_through_its_stance_and_gives_it_up_in_the_next_swing() -> None:
    down = Touchdown(period=STEP)
    for _ in range(5):
        down.step(only_leg(2), np.full(6, 0.002), YES, NO, NO, NO)
    for _ in range(100):
        down.step(YES, STILL, NO, YES, NO, NO)
    assert down.offset[2] == pytest.approx(0.01)
    for k in range(1, 40):
        down.step(NO, STILL, YES, NO, NO, NO)
        assert down.offset[2] == pytest.approx(0.01 * math.exp(-k * STEP / 0.06))
    for _ in range(60):
        down.step(NO, STILL, YES, NO, NO, NO)
    assert down.offset[2] == 0.0
    assert not down.busy()


def test_a_foot_that_finds_no_ground_reaches_down_after_the_grace_time_to_the_limit() -> None:
    down, missing = Touchdown(period=STEP), ~only_leg(2)
    offsets = []
    for _ in range(150):
        down.step(missing, STILL, NO, YES, NO, NO)
        offsets.append(down.offset[2])
    begun = next(k for k, offset in enumerate(offsets) if offset)
    assert begun in {8, 9}  # 40 ms are 8 periods; times are sums, so it may be the 9th
    reach = -0.08 * STEP * np.arange(1, 151 - begun)  # with 80 mm/s down to 40 mm
    np.testing.assert_allclose(offsets[begun:], np.maximum(reach, -0.04), atol=1e-12)


def test_an_awaited_foot_searches_at_a_speed_that_grows_and_stops_within_a_period() -> None:
    """C50: the speed grows with the time waited to the power 4, to its full value in 25 ms."""
    down, reached = Touchdown(period=STEP), 0.0
    for search in range(2):  # the second search begins as slowly as the first
        for k in range(1, 21):
            down.step(NO, STILL, YES, NO, only_leg(2), NO)
            reached -= 0.08 * STEP * min(k * STEP / 0.025, 1.0) ** 4
            assert down.offset[2] == pytest.approx(max(reached, -0.04), abs=1e-12)
        assert np.count_nonzero(down.offset) == 1
        found = down.offset[2]
        down.step(only_leg(2), STILL, YES, NO, NO, NO)
        assert down.offset[2] == found, f"search {search}"
    for _ in range(200):
        down.step(NO, STILL, YES, NO, only_leg(2), NO)
    assert down.offset[2] == -0.04


@pytest.mark.parametrize("height", [0.012, -0.012])
@pytest.mark.parametrize("swings", [True, False])
def test_a_foot_whose_sensor_has_just_been_doubted_returns_to_its_path_in_its_stance_too(
    height: float, swings: bool
) -> None:
    down = Touchdown(period=STEP)
    down.restore({"offset": np.full(6, height), "late": np.full(6, 0.05)})
    swinging, loaded = (YES, NO) if swings else (NO, YES)
    for k in range(1, 20):
        down.step(YES, STILL, swinging, loaded, only_leg(3), only_leg(2))
        assert down.offset[2] == pytest.approx(height * math.exp(-k * STEP / 0.06))
    assert down.offset[1] == height
    for _ in range(100):
        down.step(NO, np.full(6, 0.001), swinging, loaded, only_leg(2), only_leg(2))
    assert down.offset[2] == 0.0
    assert down.late[2] == 0.0


def test_the_laws_reach_for_ground_that_is_missing_while_the_others_carry_the_weight() -> None:
    laws, force = make_laws(), squeezing(0.0)
    force[:, 2] *= 6.0 / 5.0
    force[1] = 0.0
    plan(laws)
    for _ in range(150):
        laws.feel(force)
    assert laws.touchdown.offset[1] == -0.04
    assert not laws.doubted.any()
    assert ROBOT.gait.step_height >= 0.04


# Tests at what height a foot is expected to meet the ground.

LOW = np.zeros(6)
ALL, NONE = np.ones(6, dtype=bool), np.zeros(6, dtype=bool)
FIRST = np.array([True, False, True, False, True, False])  # a tripod
ONLY_TOUCHDOWN = Parts(support=False, fallback=False)


def step(landings: Landings, swinging: np.ndarray, heights: list[float]) -> None:
    """Takes a step in which these legs swing and land at heights [m], while the others stand."""
    landings.update(~swinging, np.full(6, 0.03), swinging)
    landings.update(ALL, np.array(heights), swinging)
    landings.update(ALL, LOW, NONE)


def landed() -> Landings:
    """Returns the landings of feet that have all met the ground at 10 mm."""
    landings = Landings()
    for swinging in (FIRST, ~FIRST, FIRST, ~FIRST):
        step(landings, swinging, [0.010] * 6)
    return landings


def test_feet_are_expected_as_low_as_the_lowest_of_the_others() -> None:
    landings = Landings()
    step(landings, FIRST, [0.012, 0.0, 0.010, 0.0, 0.014, 0.0])
    step(landings, ~FIRST, [0.0, 0.015, 0.0, 0.011, 0.0, 0.013])
    np.testing.assert_allclose(
        landings.expected(ALL, LOW, NONE), [0.010, 0.010, 0.011, 0.010, 0.010, 0.010]
    )


def test_a_foot_is_expected_where_it_came_down_a_step_before() -> None:
    landings = Landings()
    for swinging in (FIRST, ~FIRST):
        step(landings, swinging, [0.0] * 6)
    np.testing.assert_array_equal(landings.expected(ALL, LOW, NONE), 0.0)
    step(landings, FIRST, [0.012, 0.0, 0.0, 0.0, 0.0, 0.0])
    # the first landing at this height counts as a bump
    assert landings.expected(ALL, LOW, NONE)[0] == 0.0
    step(landings, FIRST, [0.012, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(landings.expected(ALL, LOW, NONE), [0.012, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(("above", "early"), [(0.0019, False), (0.0021, True)])
def test_a_foot_is_early_that_meets_the_ground_two_millimetres_above_where_it_is_expected(
    above: float, early: bool
) -> None:
    """All feet have landed at 10 mm before; now foot 0 meets a bump."""
    landings = landed()
    expected = landings.expected(ALL, LOW, NONE)
    step(landings, np.arange(6) == 0, [0.010 + above, *[0.0] * 5])
    np.testing.assert_array_equal(landings.early(expected, np.full(6, 0.03)), [early, *[False] * 5])


@pytest.mark.parametrize(("above", "early"), [(0.0019, False), (0.0021, True)])
def test_a_foot_is_early_only_while_its_path_is_two_millimetres_above_the_common_ground(
    above: float, early: bool
) -> None:
    landings = landed()
    expected = landings.expected(ALL, LOW, NONE)
    step(landings, np.arange(6) == 0, [0.020, *[0.0] * 5])
    assert landings.early(expected, np.full(6, 0.010 + above))[0] == early


def walk(laws: Laws, ground: np.ndarray, steps: int) -> list[np.ndarray]:
    """Walks with two alternating tripods whose feet come down from 25 mm at 0.25 m/s onto ground of
    these heights [m] (6,).

    Returns the offsets at the end of each step.
    """
    found = []
    for k in range(steps):
        swinging = FIRST if k % 2 == 0 else ~FIRST
        standing = "".join("0" if swings else "1" for swings in swinging)
        for height in np.arange(0.025, -1e-9, -0.25 * PERIOD):
            force = squeezing(0.0)
            force[swinging & (height > ground), 2] = 0.0
            force[swinging & (height <= ground), 2] = 0.05 * WEIGHT
            plan(laws, standing=standing, height=height, rise=-0.25)
            laws.feel(force)
        found.append(laws.touchdown.offset)
    return found


def test_ground_that_all_feet_meet_early_raises_none_and_a_bump_raises_the_foot_on_it() -> None:
    sunk, bump = np.full(6, 0.012), np.array([0.012, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert np.abs(walk(make_laws(parts=ONLY_TOUCHDOWN), sunk, 8)).max() < 1e-12
    offsets = walk(make_laws(parts=ONLY_TOUCHDOWN), bump, 1)[0]
    assert 0.005 < offsets[0] < 0.012
    assert not offsets[1:].any()
