"""Tests the detection of touch-down and lift-off without flicker, and the distinction between
faulty sensors and missing ground.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.sense.contact_detection import ContactDetector, SensorWatch

WEIGHT, CYCLE, PERIOD = 50.0, 1.0, 0.005  # N, s, s
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
