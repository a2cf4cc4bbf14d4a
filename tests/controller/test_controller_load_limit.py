"""Tests the control of a robot that is heavier than its servos can carry.

The support is reduced; a robot that is far too heavy walks under kinematic control.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gains import PERIOD
from standing import GAINS, make_laws, plan, shared

from hexapod_cosim.controller.sense.load_limit import LoadLimit

MOST, CYCLE = 5.0, 1.0  # N m, s
WEIGHT_TIME = 0.5  # s; a fifth of it smooths the measured weight


def make() -> LoadLimit:
    return LoadLimit(most=MOST, cycle=CYCLE, period=PERIOD, weight_time=WEIGHT_TIME)


def of_weight(ratio: float) -> LoadLimit:
    """Returns a limit that has converged to a measured weight, given over the modelled one."""
    load_limit = make()
    for _ in range(4000):
        load_limit.weigh(ratio)
    return load_limit


@pytest.mark.parametrize(
    ("needed", "scale", "strength"),
    [
        (2.0, 1.0, 1.0),
        (2.5, 2.0, 1.0),
        (5.0 / 0.9, 1.0, 0.9),
        (5.0 / 1.68, 2.0, 0.84),
        (5.0 / 0.69, 1.0, 0.42),
        (5.0 / 0.54, 1.0, 0.0),
        (20.0, 1.0, 0.0),
    ],
)  # fmt: skip
def test_no_servo_is_asked_for_more_than_it_may_and_for_less_where_the_arch_has_to_help(
    needed: float, scale: float, strength: float
) -> None:
    """The support has all of the allowed torque down to 84 % of the needed torque, and none below
    54 %.
    """
    load_limit = make()
    load_limit.step(needed, scale)
    assert load_limit.strength == pytest.approx(strength, abs=1e-9)
    assert load_limit.strength * scale * needed <= MOST * (1.0 + 1e-12)


def test_far_too_heavy_is_half_more_than_servos_carry_and_stays_so_down_to_a_third() -> None:
    load_limit, found = of_weight(1.0), []
    for needed in (7.4, 7.6, 6.8, 6.7, 7.4, 7.6):
        load_limit.peak = 0.0  # without the peak of the steps before
        load_limit.step(needed, 1.0)
        found.append(load_limit.overloaded)
    assert found == [False, True, True, False, False, True]


def test_the_measured_weight_is_smoothed_and_believed_between_half_and_four_times() -> None:
    load_limit = make()
    for k in range(1, 200):
        load_limit.weigh(2.0)
        assert load_limit.weight_ratio == pytest.approx(2.0 - math.exp(-k * PERIOD / 0.1))
    assert of_weight(0.0).weight_ratio == pytest.approx(0.5)
    assert of_weight(1e9).weight_ratio == pytest.approx(4.0)


def test_the_largest_torque_of_late_fades_by_e_in_a_gait_cycle() -> None:
    load_limit = make()
    load_limit.step(10.0, 1.0)
    for _ in range(round(CYCLE / PERIOD)):
        load_limit.step(0.0, 1.0)
    assert load_limit.strength == 1.0
    assert load_limit.peak == pytest.approx(10.0 * math.exp(-1.0))


def carried() -> np.ndarray:
    """Returns the torques (6, 3) for the planned load [N m]."""
    laws = make_laws()
    plan(laws)
    return laws.planned.carry


def test_a_robot_far_too_heavy_goes_over_to_kinematic_control_and_back() -> None:
    weak = replace(GAINS, limits=replace(GAINS.limits, torque=float(np.abs(carried()).max())))
    laws = make_laws(gains=weak)
    plan(laws)
    normal = shared(laws)
    for ratio, falls_back in ((1.45, False), (1.55, True), (1.4, True), (1.3, False)):
        for _ in range(1000):
            laws.feel(ratio * normal)
        assert bool(laws.fallback.all()) is falls_back
        assert bool(laws.torque.any()) is not falls_back
