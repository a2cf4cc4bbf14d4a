"""Tests which leg carries what: the hand-over between legs, and shares that balance forces and
moments.
"""

from __future__ import annotations

import numpy as np
import pytest
from gains import make_gains, weight

from hexapod_cosim.controller import LegSolver, make_gait
from hexapod_cosim.controller.comply.support import Support
from hexapod_cosim.controller.gains import SupportGains
from hexapod_cosim.controller.walk.inverse_dynamics import Demand, InverseDynamics
from hexapod_cosim.models import GAITS, Robot, load_robot

ROBOT = load_robot("athena")
WEIGHT = weight(ROBOT)
HOME = LegSolver(ROBOT).forward(ROBOT.stance)[:, :2] @ np.array([1.0, 1.0j])
CLOCKS = np.linspace(0.0, 1.0, 1000, endpoint=False) + 1e-7  # cycles
ALL, NONE = np.ones(6, dtype=bool), np.zeros(6, dtype=bool)
RIDGED = 1e-8 * WEIGHT  # N, N m; ten times what the ridge of 1e-9 changes in the balance
BALANCED = ("111111", "101010", "010101", "110111", "101101", "011110")


def make(
    gait: str | None = None, *, robot: Robot = ROBOT, handover: float | None = None
) -> Support:
    gains = (
        make_gains(robot).support
        if handover is None
        else SupportGains(handover_time=handover, weight_time=0.5, load_time=0.03)
    )
    return Support(
        robot,
        make_gait(robot, gait),
        gains,
        rest=InverseDynamics(robot, LegSolver(robot), period=0.005).rest(),
    )


def demand(
    *, push: complex = 0j, moment: complex = 0j, twist: float = 0.0, load: float = WEIGHT
) -> Demand:
    """Returns the demand of one step that needs no torques."""
    return Demand(np.zeros((6, 3)), np.zeros((6, 3, 3)), push, load, moment, twist)


def normal_shares(
    support: Support, feet: np.ndarray, active: np.ndarray, asked: Demand
) -> np.ndarray:
    return support.share_normal(feet, active, asked.weight, asked.moment)


def legs(standing: str) -> np.ndarray:
    return np.array([float(flag) for flag in standing])


def phases(gait: str) -> np.ndarray:
    timing = make_gait(ROBOT, gait)
    return np.array([timing.phase(clock) for clock in CLOCKS])


@pytest.mark.parametrize("gait", GAITS)
def test_a_leg_is_active_in_its_stance_and_hands_over_half_before_and_half_after(gait: str) -> None:
    support, timing, phase = make(gait), make_gait(ROBOT, gait), phases(gait)
    active = support.activation(phase, NONE, NONE, walking=True)
    half = 0.5 * make_gains(ROBOT).support.handover_time / timing.period
    from_begin, to_end = (phase + 0.5) % 1.0 - 0.5, (phase - timing.duty + 0.5) % 1.0 - 0.5
    inside = (phase > half) & (phase < timing.duty - half)
    outside = (phase > timing.duty + half) & (phase < 1.0 - half)
    assert (active[inside] == 1.0).all()
    assert (active[outside] == 0.0).all()
    for since, sign in ((from_begin, 1.0), (to_end, -1.0)):
        near = np.abs(since) < half
        x = 0.5 + 0.5 * sign * since[near] / half
        np.testing.assert_allclose(active[near], x**3 * (10.0 - 15.0 * x + 6.0 * x**2), atol=1e-9)


def test_what_one_tripod_gives_up_the_other_takes() -> None:
    active = make("tripod").activation(phases("tripod"), NONE, NONE, walking=True)
    np.testing.assert_allclose(
        active[:, :3].sum(axis=1) + active[:, 3:].sum(axis=1), 3.0, atol=1e-9
    )
    np.testing.assert_allclose(active[:, 0] + active[:, 1], 1.0, atol=1e-9)


@pytest.mark.parametrize("gait", GAITS)
def test_hand_overs_are_smooth(gait: str) -> None:
    active = make(gait).activation(phases(gait), NONE, NONE, walking=True)
    width = 0.05 / make_gait(ROBOT, gait).period  # cycles
    slope = np.diff(active, axis=0) * len(CLOCKS)
    assert np.abs(slope).max() < 1.9 / width  # the largest slope of a quintic is 1.875
    assert (
        np.abs(np.diff(slope, axis=0)).max() * len(CLOCKS) < 5.8 / width**2
    )  # its largest second derivative is 5.77


@pytest.mark.parametrize("standing", BALANCED)
def test_shares_balance_force_and_moment(standing: str) -> None:
    asked = demand(push=3.0 - 2.0j, moment=WEIGHT * (0.02 - 0.01j), twist=0.4)
    shares = make().shares(HOME, legs(standing), asked)
    assert shares.normal.sum() == pytest.approx(WEIGHT, abs=RIDGED)
    assert shares.normal @ HOME == pytest.approx(asked.moment, abs=RIDGED)
    assert shares.push.sum() == pytest.approx(3.0 - 2.0j, abs=1e-9)
    assert (HOME.conj() * shares.push).imag.sum() == pytest.approx(0.4, abs=1e-9)
    # pushes per load are those of a moving and turning body, so none squeezes another
    carries = shares.normal > 0.0
    per, arm = shares.push[carries] / shares.normal[carries], HOME[carries] - HOME[carries].mean()
    spin = (arm.conj() * per).imag.sum() / (abs(arm) ** 2).sum()
    np.testing.assert_allclose(per, per.mean() + 1j * spin * arm, rtol=1e-6, atol=1e-9)
    assert not shares.normal[legs(standing) == 0.0].any()
    np.testing.assert_array_equal(
        shares.forces(), np.column_stack([shares.push.real, shares.push.imag, shares.normal])
    )


def test_of_all_shares_that_balance_the_sum_of_squares_is_least() -> None:
    """Any change that keeps force and moment increases sum f^2/a by second order."""
    active = np.array([1.0, 0.4, 1.0, 0.7, 1.0, 0.2])
    normal = normal_shares(make(), HOME, active, demand(moment=WEIGHT * 0.01))
    balance = np.array([np.ones(6), HOME.real, HOME.imag])
    free = np.linalg.svd(balance)[2][3:]
    np.testing.assert_allclose(free @ (normal / active), 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("standing", "least"), [("010010", 0.999), ("100001", 0.999), ("010000", 0.8)]
)
def test_two_feet_or_one_carry_what_they_can_without_their_moment(
    standing: str, least: float
) -> None:
    normal = normal_shares(make(), HOME, legs(standing), demand())
    assert least * WEIGHT < normal.sum() < 1.001 * WEIGHT
    assert not normal[legs(standing) == 0.0].any()
    assert normal.min() >= 0.0


def test_feet_within_a_centimetre_take_no_yaw_moment_and_a_micronewton_is_no_load() -> None:
    for reach, turns in ((0.0099, False), (0.0101, True)):
        feet = np.array([reach * 1j, -reach * 1j, 0j, 0j, 0j, 0j])
        shares = make().shares(feet, legs("110000"), demand(twist=0.4))
        assert bool(shares.push.any()) is turns
    for load, part in ((0.5e-6, 0.5), (1.0e-6, 1.0), (3e-6, 1.0)):
        shares = make().shares(HOME, legs("111111"), demand(push=2.0 + 0j, load=load))
        assert shares.push.sum().real == pytest.approx(2.0 * part, rel=0.01)


@pytest.mark.parametrize("name", ["athena", "phantomx_mk4"])
def test_feet_are_lowered_by_what_they_press_in_beyond_the_stance(name: str) -> None:
    robot = load_robot(name)
    support, home = (
        make(robot=robot),
        LegSolver(robot).forward(robot.stance)[:, :2] @ np.array([1.0, 1.0j]),
    )
    rest = (weight(robot) / 6.0 / robot.contact.stiffness) ** (2.0 / 3.0)
    three = support.lowering(home, legs("101010"))
    load = normal_shares(
        support, home, legs("101010"), InverseDynamics(robot, LegSolver(robot), period=0.005).rest()
    )
    np.testing.assert_allclose(
        three, (load / robot.contact.stiffness) ** (2.0 / 3.0) - rest, atol=1e-12
    )
    assert (three[[0, 2, 4]] > 0.0).all()
    np.testing.assert_allclose(three[[1, 3, 5]], -rest, atol=1e-12)
    np.testing.assert_allclose(support.lowering(home, legs("111111")).mean(), 0.0, atol=0.02 * rest)
