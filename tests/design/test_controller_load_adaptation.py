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


def test_the_weight_of_the_squeeze_is_no_steeper_than_the_design_page_says() -> None:
    """The margins of its loops, which docs/control/design.md gives, follow from these slopes."""
    held, work = [], []
    for share in np.linspace(0.7, 0.9, 401):
        adaptation = make(0.3)
        adaptation.step(loaded(0.1), 0.5, share)
        held.append(adaptation.squeeze)
    for part in np.linspace(0.9, 1.3, 401):
        adaptation = make(0.3)
        adaptation.work = np.full((6, 3), part * RATING**2)
        adaptation.follow_work = 0.0
        adaptation.step(loaded(0.1), 0.5, LOST)
        work.append(adaptation.squeeze)
    assert np.diff(held).max() / 0.0005 == pytest.approx(65.0 / 7.0, rel=1e-6)
    assert np.diff(work).max() / 0.001 == pytest.approx(3.25, rel=1e-6)


def test_cool_servos_keep_the_weight_that_was_set_and_none_stays_none() -> None:
    for squeeze in (0.0, 0.3, 0.97):
        adaptation = make(squeeze)
        assert adaptation.squeeze == squeeze
    nothing = make(0.0)
    nothing.heat = np.full((6, 3), 10.0)
    nothing.step(loaded(9.0), 2.0, 1.0)
    assert nothing.squeeze == 0.0


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


def test_a_gait_without_a_narrow_stance_keeps_its_squeeze_under_any_weight() -> None:
    found = weighed(make(), 2.0)
    assert (found.narrowing, found.squeeze) == (0.0, 0.4)


def test_a_saved_load_adaptation_goes_on_the_same_and_a_reset_one_is_cool() -> None:
    adaptation, other = make(), make()
    for _ in range(1000):
        adaptation.step(loaded(4.0), 0.5, LOST)
    other.restore(adaptation.save())
    for one in (adaptation, other):
        one.step(loaded(2.0), 0.5, LOST)
    assert adaptation.squeeze == other.squeeze > 0.4
    assert (adaptation.heat == other.heat).all()
    assert (adaptation.work == other.work).all()
    adaptation.reset()
    assert adaptation.squeeze == 0.4
    assert not adaptation.heat.any()
    assert not adaptation.work.any()


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
