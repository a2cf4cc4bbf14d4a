"""Tests that the squeeze grows on ground that holds it, and as servos need it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gains import PERIOD

from hexapod_cosim.controller.sense.load_adaptation import (
    COOL,
    HEAT_TIME,
    HOT,
    MOST_SQUEEZE,
    LoadAdaptation,
)

RATING = 1.2  # N m
MINUTE = round(HEAT_TIME / PERIOD)  # periods
CYCLE = 1.0  # s
LOST = 0.4  # share of the planned squeeze that is held on ground on which feet creep


def make(squeeze: float = 0.4, *, narrows: bool = False) -> LoadAdaptation:
    return LoadAdaptation(
        rating=RATING, squeeze=squeeze, narrows=narrows, cycle=CYCLE, period=PERIOD
    )


def loaded(largest: float) -> np.ndarray:
    """Returns torques (6, 3) of which one is the largest [N m]."""
    torque = np.full((6, 3), 0.3 * largest)
    torque[4, 1] = -largest
    return torque


def test_heat_nears_the_square_of_a_constant_torque_by_e_in_a_minute() -> None:
    adaptation = make()
    for _ in range(MINUTE):
        adaptation.step(loaded(1.0), 0.5, LOST)
    assert adaptation.heat.max() == pytest.approx(1.0 - math.exp(-1.0))
    assert int(adaptation.heat.argmax()) == 4 * 3 + 1


@pytest.mark.parametrize(
    ("share", "expected"),
    [(0.5, 0.4), (COOL, 0.4), (0.9, 0.5 * (0.4 + MOST_SQUEEZE)), (HOT, MOST_SQUEEZE), (3.0, 0.95)],
)
def test_the_squeeze_follows_the_hottest_servo(share: float, expected: float) -> None:
    adaptation = make()
    for _ in range(20 * MINUTE // 100):
        adaptation.follow = 1.0 - math.exp(-100.0 * PERIOD / HEAT_TIME)
        adaptation.step(loaded(math.sqrt(share) * RATING), 0.5, LOST)
    assert adaptation.squeeze == pytest.approx(expected, abs=1e-6)


def weighed(adaptation: LoadAdaptation, heft: float, *, held: float = LOST) -> LoadAdaptation:
    """Returns the adaptation after ten cycles with cool servos and a constant weight."""
    for _ in range(round(10.0 * CYCLE / PERIOD)):
        adaptation.weigh(heft)
        adaptation.step(loaded(0.1), 0.5, held)
    return adaptation


@pytest.mark.parametrize(
    ("heft", "narrowing", "squeeze"),
    [(0.8, 0.0, 0.4), (1.1, 0.0, 0.4), (1.15, 0.5, 0.25), (1.2, 1.0, 0.1), (2.0, 1.0, 0.1)],
)
def test_a_weight_above_the_models_narrows_the_stance_and_spares_the_squeeze(
    heft: float, narrowing: float, squeeze: float
) -> None:
    found = weighed(make(narrows=True), heft)
    assert (found.narrowing, found.squeeze) == pytest.approx((narrowing, squeeze), abs=1e-3)


def test_in_the_narrow_stance_ground_that_holds_does_not_raise_the_squeeze() -> None:
    assert weighed(make(narrows=True), 1.0, held=1.0).squeeze == pytest.approx(0.95)
    assert weighed(make(narrows=True), 1.4, held=1.0).squeeze == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("needed", "expected"), [(0.8, 0.4), (0.9, 0.675), (1.0, MOST_SQUEEZE), (4.0, MOST_SQUEEZE)]
)
def test_the_squeeze_grows_at_once_when_the_weight_needs_nearly_all_the_torque(
    needed: float, expected: float
) -> None:
    adaptation = make()
    adaptation.step(np.zeros((6, 3)), needed, LOST)
    assert adaptation.squeeze == pytest.approx(expected)
    adaptation.step(np.zeros((6, 3)), 0.3, LOST)
    assert adaptation.squeeze == 0.4


@pytest.mark.parametrize(
    ("held", "expected"), [(0.0, 0.4), (0.75, 0.4), (0.785, 0.675), (0.82, 0.95), (1.0, 0.95)]
)
def test_the_squeeze_grows_where_the_ground_holds_it(held: float, expected: float) -> None:
    adaptation = make()
    adaptation.step(np.zeros((6, 3)), 0.5, held)
    assert adaptation.squeeze == pytest.approx(expected)


@pytest.mark.parametrize(("share", "expected"), [(0.9, 0.4), (1.1, 0.675), (1.2, 0.95)])
def test_the_squeeze_grows_within_some_gait_cycles_when_a_servo_works_above_its_rating(
    share: float, expected: float
) -> None:
    adaptation = make()
    for _ in range(round(12.0 * CYCLE / PERIOD)):
        adaptation.step(loaded(math.sqrt(share) * RATING), 0.5, LOST)
    assert adaptation.squeeze == pytest.approx(expected, abs=1e-4)
    assert adaptation.heat.max() < COOL * RATING**2
