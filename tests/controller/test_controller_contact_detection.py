"""Tests the detection of touch-down and lift-off without flicker, and the distinction between
faulty sensors and missing ground.
"""

from __future__ import annotations

import numpy as np
import pytest

from hexapod_cosim.controller.sense.contact_detection import ContactDetector, SensorWatch

WEIGHT, CYCLE, PERIOD = 50.0, 1.0, 0.005  # N, s, s
TOUCHES, LIFTS = 1.0, 0.25  # N; 2 % and 0.5 % of the weight
NONE, ALL = np.zeros(6, dtype=bool), np.ones(6, dtype=bool)


def only(*legs: int) -> np.ndarray:
    return np.isin(np.arange(6), legs)


def but(*legs: int) -> np.ndarray:
    return ~only(*legs)


def test_a_foot_touches_down_above_2_percent_of_the_weight_and_lifts_off_below_half_a_percent() -> (
    None
):
    detector = ContactDetector(WEIGHT)
    forces = [0.0, 0.6, 0.99, 1.01, 0.6, 0.26, 0.24, 0.6, 0.99, 1.01]  # N
    found = [bool(detector.step(np.full(6, force))[2]) for force in forces]
    assert found == [False, False, False, True, True, True, False, False, False, True]


@pytest.mark.parametrize("level", [TOUCHES, LIFTS, 0.5 * (TOUCHES + LIFTS)])
def test_noise_on_a_force_near_a_threshold_makes_no_foot_flicker(level: float) -> None:
    detector, generator = ContactDetector(WEIGHT), np.random.default_rng(0)
    noise = (TOUCHES - LIFTS) / 3.0  # N; a third of the hysteresis to either side
    states = np.array(
        [detector.step(level + generator.uniform(-noise, noise, 6)) for _ in range(2000)]
    )
    assert np.count_nonzero(np.diff(states.astype(int), axis=0), axis=0).max() <= 1


def test_feet_are_told_apart_and_what_was_found_before_is_left_alone() -> None:
    detector = ContactDetector(WEIGHT)
    first = detector.step(np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0]) * WEIGHT)
    state = detector.save()
    second = detector.step(np.array([0.0, 1.0, 0.0, 1.0, 0.0, 1.0]) * WEIGHT)
    np.testing.assert_array_equal(first, ~second)
    detector.restore(state)
    np.testing.assert_array_equal(detector.touching, first)


def until_doubted(watch: SensorWatch, leg: int, **seen: np.ndarray | float) -> int:
    """Returns the time [s] after which a sensor is doubted; no other sensor may ever be doubted."""
    for count in range(1, 1000):
        doubted = watch.look(**seen)  # type: ignore[arg-type]
        assert not any(doubted[other] for other in range(6) if other != leg)
        if doubted[leg]:
            return count
    return 0


def test_a_dead_sensor_of_a_foot_that_carries_is_doubted_after_a_tenth_of_a_second() -> None:
    watch = SensorWatch(WEIGHT, cycle=CYCLE, period=PERIOD)
    count = until_doubted(watch, 2, touching=but(2), total=40.0, standing=ALL, high=NONE)
    assert count in {20, 21}  # times are sums of periods


def test_a_stuck_sensor_of_a_foot_in_mid_swing_is_doubted_after_60_milliseconds() -> None:
    watch = SensorWatch(WEIGHT, cycle=CYCLE, period=PERIOD)
    count = until_doubted(watch, 2, touching=ALL, total=WEIGHT, standing=but(2), high=only(2))
    assert count in {12, 13}


def test_a_missing_foothold_whose_weight_the_others_carry_is_not_a_dead_sensor() -> None:
    watch = SensorWatch(WEIGHT, cycle=CYCLE, period=PERIOD)
    for _ in range(1000):
        assert not any(watch.look(but(2), 46.1, ALL, NONE))  # N; 92 % of the weight are 46
    assert not watch.busy()
    assert until_doubted(watch, 2, touching=but(2), total=45.9, standing=ALL, high=NONE)


def test_contradictions_shorter_than_that_never_add_up() -> None:
    watch = SensorWatch(WEIGHT, cycle=CYCLE, period=PERIOD)
    for _ in range(50):
        for _ in range(18):
            assert not watch.look(but(2), 0.5 * WEIGHT, ALL, NONE).any()
        assert not watch.look(ALL, WEIGHT, ALL, NONE).any()


def test_a_foot_that_need_not_carry_or_is_not_high_contradicts_nothing() -> None:
    watch = SensorWatch(WEIGHT, cycle=CYCLE, period=PERIOD)
    for _ in range(200):
        assert not watch.look(NONE, 0.0, NONE, ALL).any()
        assert not watch.look(ALL, WEIGHT, NONE, NONE).any()
    assert not watch.busy()


def test_a_sensor_is_trusted_again_after_one_and_a_half_cycles_without_contradiction() -> None:
    watch = SensorWatch(WEIGHT, cycle=CYCLE, period=PERIOD)
    until_doubted(watch, 2, touching=but(2), total=0.5 * WEIGHT, standing=ALL, high=NONE)
    count = 0
    while watch.look(ALL, WEIGHT, ALL, NONE)[2]:
        assert watch.busy()
        count += 1
    assert abs(count - 300) <= 2
    assert not watch.busy()


def test_a_sensor_that_stays_dead_stays_doubted() -> None:
    watch = SensorWatch(WEIGHT, cycle=CYCLE, period=PERIOD)
    until_doubted(watch, 2, touching=but(2), total=0.5 * WEIGHT, standing=ALL, high=NONE)
    for k in range(1000):
        stands = k // 100 % 2 == 0  # the robot walks, and the sensor is dead in stance only
        assert watch.look(
            but(2), 0.5 * WEIGHT, ALL if stands else but(2), NONE if stands else only(2)
        )[2]


def test_what_is_saved_does_not_change() -> None:
    watch = SensorWatch(WEIGHT, cycle=CYCLE, period=PERIOD)
    for _ in range(10):
        watch.look(but(2), 0.5 * WEIGHT, ALL, NONE)
    state = watch.save()
    left = until_doubted(watch, 2, touching=but(2), total=0.5 * WEIGHT, standing=ALL, high=NONE)
    watch.restore(state)
    assert not watch.doubted.any()
    assert watch.busy()
    assert (
        until_doubted(watch, 2, touching=but(2), total=0.5 * WEIGHT, standing=ALL, high=NONE)
        == left
    )
