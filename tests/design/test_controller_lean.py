"""Tests the measured centre of mass: the load plan moves to where the load is."""

from __future__ import annotations

import numpy as np
import pytest
from gains import PERIOD, make_gains
from standing import DEPTH, HOME, ROBOT, WEIGHT, Laws, make_laws, plan, rest, shared

from hexapod_cosim.controller import make_gait
from hexapod_cosim.controller.comply.support import Support

CYCLE = round(make_gait(ROBOT).period / PERIOD)  # periods
TURNED = 1e-9  # m; round-off and the ridge of the shares


def support() -> Support:
    return Support(ROBOT, make_gait(ROBOT), make_gains(ROBOT).support, rest=rest(ROBOT))


def loads(place: complex) -> np.ndarray:
    """Returns forces (6, 3) of a robot that stands on all legs with its mass at a place."""
    force = np.zeros((6, 3))
    force[:, 2] = support().share_normal(HOME, np.ones(6), WEIGHT, WEIGHT * place)
    return force


def feel(laws: Laws, place: complex, steps: int) -> None:
    """Lets the robot stand, with a plan that follows the measured centre of mass."""
    share, still = support(), rest(ROBOT)
    for _ in range(steps):
        moment = still.moment + still.weight * laws.lean
        shares = share.shares(HOME, np.ones(6), still._replace(moment=moment))
        plan(laws)
        laws.planned = laws.planned._replace(shares=shares)
        laws.feel(loads(place))


def test_the_plan_reaches_the_centre_of_load_by_e_in_a_gait_cycle() -> None:
    laws, place = make_laws(), 0.01 - 0.02j
    feel(laws, place, CYCLE)
    assert laws.lean == pytest.approx(place * (1.0 - np.exp(-1.0)), abs=TURNED)
    feel(laws, place, 20 * CYCLE)
    assert laws.lean == pytest.approx(place, abs=1e-7)
    centre = laws.planned.shares.normal @ HOME / laws.planned.weight
    assert centre == pytest.approx(place, abs=1e-7)


def test_the_distance_is_limited_and_centred_loads_have_none() -> None:
    laws = make_laws()
    feel(laws, 0j, CYCLE)
    assert abs(laws.lean) < TURNED
    feel(laws, 0.09 + 0.0j, 20 * CYCLE)
    assert laws.lean.real == 0.4 * DEPTH
    assert abs(laws.lean.imag) < TURNED


def test_a_doubted_sensor_stops_the_estimate() -> None:
    laws = make_laws()
    plan(laws, height=0.0)
    force = shared(laws)
    force[3] = 0.0
    for _ in range(3 * CYCLE):
        laws.feel(0.9 * force)
    before = laws.lean
    assert laws.doubted[3]
    laws.feel(0.9 * force)
    assert laws.lean == before
