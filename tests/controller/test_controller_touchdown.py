"""Tests ground that is met early or late: a foot is not pressed into early ground, and reaches down
for late ground.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from standing import ROBOT, make_laws, plan, squeezing

from hexapod_cosim.controller.sense.touchdown import Touchdown

PERIOD = 0.005  # s
YES, NO, STILL = np.ones(6, dtype=bool), np.zeros(6, dtype=bool), np.zeros(6)


def only(leg: int) -> np.ndarray:
    return np.asarray(np.arange(6) == leg)


def test_a_foot_that_meets_the_ground_early_keeps_the_height_at_which_it_touched() -> None:
    down, height, total = Touchdown(period=PERIOD), 0.02, 0.0
    heights = []
    for _ in range(15):
        fall = 0.001
        height -= fall
        down.step(only(2), np.full(6, fall), YES, NO, NO, NO)
        total += fall
        heights.append(height + down.offset[2])
    np.testing.assert_allclose(heights, 0.02, atol=1e-12)
    assert down.offset[2] == pytest.approx(total)
    assert [down.offset[leg] for leg in (0, 1, 3, 4, 5)] == [0.0] * 5


def test_it_keeps_it_through_its_stance_and_gives_it_up_in_the_next_swing() -> None:
    down = Touchdown(period=PERIOD)
    for _ in range(5):
        down.step(only(2), np.full(6, 0.002), YES, NO, NO, NO)
    for _ in range(100):
        down.step(YES, STILL, NO, YES, NO, NO)
    assert down.offset[2] == pytest.approx(0.01)
    for k in range(1, 40):
        down.step(NO, STILL, YES, NO, NO, NO)
        assert down.offset[2] == pytest.approx(0.01 * math.exp(-k * PERIOD / 0.06))
    for _ in range(60):
        down.step(NO, STILL, YES, NO, NO, NO)
    assert down.offset[2] == 0.0
    assert not down.busy()


def test_a_foot_that_finds_no_ground_reaches_down_after_the_grace_time_to_the_limit() -> None:
    down, missing = Touchdown(period=PERIOD), ~only(2)
    offsets = []
    for _ in range(150):
        down.step(missing, STILL, NO, YES, NO, NO)
        offsets.append(down.offset[2])
    begun = next(k for k, offset in enumerate(offsets) if offset)
    assert begun in {8, 9}  # 40 ms are 8 periods; times are sums, so it may be the 9th
    reach = -0.08 * PERIOD * np.arange(1, 151 - begun)  # with 80 mm/s down to 40 mm
    np.testing.assert_allclose(offsets[begun:], np.maximum(reach, -0.04), atol=1e-12)


def test_an_awaited_foot_searches_at_once_at_a_set_speed_and_stops_within_a_period() -> None:
    down = Touchdown(period=PERIOD)
    for k in range(1, 21):
        down.step(NO, STILL, YES, NO, only(2), NO)
        assert down.offset[2] == pytest.approx(-0.08 * PERIOD * k)
    assert np.count_nonzero(down.offset) == 1
    found = down.offset[2]
    down.step(only(2), STILL, YES, NO, NO, NO)
    assert down.offset[2] == found
    for _ in range(200):
        down.step(NO, STILL, YES, NO, only(2), NO)
    assert down.offset[2] == -0.04


@pytest.mark.parametrize("height", [0.012, -0.012])
@pytest.mark.parametrize("swings", [True, False])
def test_a_foot_whose_sensor_is_doubted_returns_to_its_path_in_its_stance_too(
    height: float, swings: bool
) -> None:
    down = Touchdown(period=PERIOD)
    down.restore({"offset": np.full(6, height), "late": np.full(6, 0.05)})
    swinging, loaded = (YES, NO) if swings else (NO, YES)
    for k in range(1, 20):
        down.step(YES, STILL, swinging, loaded, only(3), only(2))
        assert down.offset[2] == pytest.approx(height * math.exp(-k * PERIOD / 0.06))
    assert down.offset[1] == height
    for _ in range(100):
        down.step(NO, np.full(6, 0.001), swinging, loaded, only(2), only(2))
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
