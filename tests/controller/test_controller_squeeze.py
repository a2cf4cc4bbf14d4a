"""Tests the planned squeeze, which balances itself and is the least of what it minimises, and its
adaptation to the ground and to the load on servos.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from gains import PERIOD, make_gains

from hexapod_cosim.controller import LegSolver, make_gait
from hexapod_cosim.controller.comply.load_plan import Shares
from hexapod_cosim.controller.comply.planned_squeeze import MOST_FRICTION, PlannedSqueeze
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.plane import Array, Plane, across
from hexapod_cosim.controller.sense.load_adaptation import (
    COOL,
    HEAT_TIME,
    HOT,
    MOST_SQUEEZE,
    LoadAdaptation,
)
from hexapod_cosim.controller.walk.inverse_dynamics import Demand, InverseDynamics
from hexapod_cosim.models import load_robot

ROBOT = load_robot("athena")
WEIGHT, FRICTION = ROBOT.weight, ROBOT.friction.mu
LEGS = LegSolver(ROBOT)
DYNAMICS = InverseDynamics(ROBOT, LEGS, period=PERIOD)
REST, DEPTH = DYNAMICS.rest(), -DYNAMICS.floor
HOME = LEGS.forward(ROBOT.stance)[:, :2] @ np.array([1.0, 1.0j])
STANDING = ("111111", "101010", "010101", "110110", "111000")
RIDGED = 1e-7 * WEIGHT  # N, N m    the ridge of the multipliers' system is 1e-9 of its trace


def shares_of(standing: str, asked: Demand = REST) -> Shares:
    support = Support(ROBOT, make_gait(ROBOT), make_gains(ROBOT).support, rest=REST)
    return support.shares(HOME, np.array([float(flag) for flag in standing]), asked)


def squeezed(
    shares: Shares, squeeze: float, *, friction: float = FRICTION, asked: Demand = REST
) -> Shares:
    planned = PlannedSqueeze(friction=friction, weight=WEIGHT, depth=DEPTH)
    return planned.add(HOME, asked, shares, squeeze)


def torque(shares: Shares, asked: Demand = REST) -> Array:
    """Returns the torques (6, 3) of the servos [N m]."""
    carried = (asked.lever @ shares.forces()[:, :, None])[:, :, 0]
    return np.asarray(asked.torque - carried)


def cost(shares: Shares, push: Plane, squeeze: float) -> float:
    """Returns the sum that the squeeze minimises (C42) [N2 m2]."""
    loaded = shares.normal > 0.0
    use = np.abs(push[loaded]) / (FRICTION * shares.normal[loaded])
    largest = DEPTH * WEIGHT / 3.0
    effort = float((torque(shares._replace(push=push)) ** 2).sum())
    return effort + (1.0 / squeeze - 1.0) * largest**2 * float((use**2).sum())


def inner(standing: str) -> Plane:
    """Returns forces (n, 6) of standing feet whose sums and moments vanish, an orthonormal base."""
    feet = [k for k, flag in enumerate(standing) if flag == "1"]
    balance = np.zeros((3, 12))
    for k in feet:
        balance[0, 2 * k], balance[1, 2 * k + 1] = 1.0, 1.0
        balance[2, 2 * k : 2 * k + 2] = -HOME[k].imag, HOME[k].real
    balance = balance[:, [2 * k + axis for k in feet for axis in (0, 1)]]
    null = np.linalg.svd(balance)[2][3:]
    found = np.zeros((len(null), 6), dtype=np.complex128)
    found[:, feet] = null[:, ::2] + 1j * null[:, 1::2]
    return found


@pytest.mark.parametrize("standing", STANDING)
@pytest.mark.parametrize("squeeze", [0.1, 0.5, 0.99])
def test_forces_and_moments_of_the_squeeze_vanish(standing: str, squeeze: float) -> None:
    before = shares_of(standing)
    after = squeezed(before, squeeze)
    change = after.push - before.push
    assert np.abs(change).max() > 0.1
    assert abs(change.sum()) < RIDGED
    assert abs(across(HOME, change).sum()) < RIDGED
    assert (after.normal == before.normal).all()
    assert (change[before.normal == 0.0] == 0.0).all()


@pytest.mark.parametrize("standing", ["111111", "101010", "110110"])
@pytest.mark.parametrize("squeeze", [0.1, 0.48, 0.9])
def test_no_other_squeeze_has_less_torque_and_friction_together(
    standing: str, squeeze: float
) -> None:
    """The cost is quadratic: at its least the differences to both sides of each direction agree."""
    shares = squeezed(shares_of(standing), squeeze)
    least = cost(shares, shares.push, squeeze)
    for direction in inner(standing):
        ahead, behind = (cost(shares, shares.push + sign * direction, squeeze) for sign in (1, -1))
        assert ahead > least
        assert behind > least
        assert ahead == pytest.approx(behind, rel=1e-6)


def test_without_weight_or_friction_nothing_is_squeezed() -> None:
    before = shares_of("101010")
    assert squeezed(before, 0.0) is before
    assert squeezed(before, 0.5, friction=0.0) is before


@pytest.mark.parametrize("friction", [0.05, 0.3, 0.7])
def test_no_foot_is_planned_beyond_its_share_of_the_friction(friction: float) -> None:
    for standing in STANDING:
        shares = squeezed(shares_of(standing), 0.99, friction=friction)
        assert (np.abs(shares.push) <= MOST_FRICTION * friction * shares.normal + RIDGED).all()


def test_feet_are_pulled_towards_each_other_so_that_the_femurs_carry_less() -> None:
    before = shares_of("101010")
    after = squeezed(before, 0.5)
    for k in (0, 2, 4):
        assert (after.push[k].conjugate() * HOME[k]).real < 0.0  # the ground pushes inwards
        assert abs(torque(after)[k, 1]) < 0.8 * abs(torque(before)[k, 1])


# Tests that the squeeze grows on ground that holds it, and as servos need it.

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


def weighed(
    adaptation: LoadAdaptation, weight_ratio: float, *, held: float = LOST
) -> LoadAdaptation:
    """Returns the adaptation after ten cycles with cool servos and a constant weight."""
    for _ in range(round(10.0 * CYCLE / PERIOD)):
        adaptation.weigh(weight_ratio)
        adaptation.step(loaded(0.1), 0.5, held)
    return adaptation


@pytest.mark.parametrize(
    ("weight_ratio", "narrowing", "squeeze"),
    [(0.8, 0.0, 0.4), (1.1, 0.0, 0.4), (1.15, 0.5, 0.25), (1.2, 1.0, 0.1), (2.0, 1.0, 0.1)],
)
def test_a_weight_above_the_models_narrows_the_stance_and_spares_the_squeeze(
    weight_ratio: float, narrowing: float, squeeze: float
) -> None:
    found = weighed(make(narrows=True), weight_ratio)
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
