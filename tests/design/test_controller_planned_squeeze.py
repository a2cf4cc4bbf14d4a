"""Tests the planned squeeze: it balances itself, and it is the least of what it minimises."""

from __future__ import annotations

import numpy as np
import pytest
from gains import PERIOD, make_gains

from hexapod_cosim.controller import LegSolver, make_gait
from hexapod_cosim.controller.comply.planned_squeeze import MOST_FRICTION, PlannedSqueeze
from hexapod_cosim.controller.comply.support import Shares, Support
from hexapod_cosim.controller.plane import Array, Plane, across
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
    shares: Shares,
    squeeze: float,
    *,
    friction: float = FRICTION,
    asked: Demand = REST,
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
