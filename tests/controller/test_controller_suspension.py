"""Tests the virtual suspension against the differential equation that it solves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gains import PERIOD, suspension
from scipy.integrate import solve_ivp

from hexapod_cosim.controller import SuspensionGains
from hexapod_cosim.controller.comply.suspension import discretise
from hexapod_cosim.models import load_robot

GAINS = suspension(load_robot("athena"))
CRITICAL = GAINS.damping
TOLERANCE = 1e-9  # relative, error of the reference solver
ROUND_OFF = 1e-13  # m


def responses(gains: SuspensionGains, forces: np.ndarray) -> np.ndarray:
    """Returns the deflection and its rate (n, 2) after each period under forces (n,)."""
    (a, b), state, found = discretise(gains, period=PERIOD), np.zeros(2), []
    for force in forces:
        state = a @ state + b * force
        found.append(state)
    return np.array(found)


@pytest.mark.parametrize("damping", [0.2 * CRITICAL, CRITICAL, 3.0 * CRITICAL])
def test_any_history_of_held_forces_gives_the_solution_of_its_equation(damping: float) -> None:
    gains, forces = replace(GAINS, damping=damping), np.random.default_rng(2).normal(size=30) * 20.0
    state = np.zeros(2)
    for force, found in zip(forces, responses(gains, forces), strict=True):

        def rate(_: float, x: np.ndarray, force: float = force) -> list[float]:
            return [x[1], (force - damping * x[1] - gains.stiffness * x[0]) / gains.mass]

        state = solve_ivp(
            rate, (0.0, PERIOD), state, rtol=TOLERANCE, atol=1e-14, method="DOP853"
        ).y[:, -1]
        np.testing.assert_allclose(found, state, rtol=1e-6, atol=1e-11)


def test_critically_damped_it_follows_a_step_by_the_closed_form_and_never_passes_it() -> None:
    force, omega = 20.0, math.sqrt(GAINS.stiffness / GAINS.mass)
    t = PERIOD * np.arange(1, 201)
    z = responses(GAINS, np.full(200, force))[:, 0]
    np.testing.assert_allclose(
        z, force / GAINS.stiffness * (1.0 - (1.0 + omega * t) * np.exp(-omega * t)), atol=ROUND_OFF
    )
    assert (np.diff(z) > 0.0).all()


def test_at_rest_it_gives_way_by_force_over_stiffness() -> None:
    z, rate = responses(GAINS, np.full(4000, 3.0))[-1]
    assert z == pytest.approx(3.0 / GAINS.stiffness, abs=ROUND_OFF)
    assert rate == pytest.approx(0.0, abs=ROUND_OFF)


def test_two_half_periods_make_a_whole() -> None:
    (half, push), (whole, pushed) = (discretise(GAINS, period=h) for h in (PERIOD / 2.0, PERIOD))
    np.testing.assert_allclose(half @ half, whole, atol=ROUND_OFF)
    np.testing.assert_allclose(half @ push + push, pushed, atol=ROUND_OFF)
