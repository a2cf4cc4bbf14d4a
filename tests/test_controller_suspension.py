"""The virtual suspension against its closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete

from hexapod_cosim.controller import Suspension, SuspensionGains

PERIOD = 0.005  # s
GAINS = SuspensionGains(mass=5.0, damping=60.0, stiffness=4000.0, preload=1.0, limit=1.0)
ROUND_OFF = 1e-13  # m


def test_the_step_response_is_the_closed_form_at_every_sample() -> None:
    suspension, force = Suspension(GAINS, period=PERIOD), 20.0
    omega = math.sqrt(GAINS.stiffness / GAINS.mass)
    zeta = GAINS.damping / (2.0 * math.sqrt(GAINS.stiffness * GAINS.mass))
    damped = omega * math.sqrt(1.0 - zeta**2)
    for k in range(1, 400):
        z, _ = suspension.step([force] * 6)
        t = k * PERIOD
        swing = math.cos(damped * t) + zeta * omega / damped * math.sin(damped * t)
        np.testing.assert_allclose(z, force / GAINS.stiffness * (1.0 - math.exp(-zeta * omega * t) * swing), atol=ROUND_OFF)


@pytest.mark.parametrize("damping", [60.0, 2.0 * math.sqrt(4000.0 * 5.0), 900.0])
def test_any_force_history_gives_the_zero_order_hold_response(damping: float) -> None:
    gains = replace(GAINS, damping=damping)
    system = np.array([[0.0, 1.0], [-gains.stiffness / gains.mass, -damping / gains.mass]])
    a, b, *_ = cont2discrete((system, np.array([[0.0], [1.0 / gains.mass]]), np.eye(2), np.zeros((2, 1))), PERIOD)
    suspension, state = Suspension(gains, period=PERIOD), np.zeros((2, 6))
    for force in np.random.default_rng(2).normal(size=(100, 6)) * 20.0:
        state = a @ state + b * force
        np.testing.assert_allclose(suspension.step(force.tolist()), state, atol=1e-12)


def test_the_rest_position_is_force_over_stiffness() -> None:
    suspension = Suspension(GAINS, period=PERIOD)
    for _ in range(4000):
        z, rate = suspension.step([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    np.testing.assert_allclose(z, np.arange(6.0) / GAINS.stiffness, atol=ROUND_OFF)
    np.testing.assert_allclose(rate, 0.0, atol=ROUND_OFF)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_deflection_stops_at_its_limit_and_stands_still_there(sign: float) -> None:
    suspension = Suspension(replace(GAINS, limit=0.004), period=PERIOD)
    for _ in range(100):
        z, rate = suspension.step([sign * 100.0] * 6)
    assert z == [sign * 0.004] * 6
    assert rate == [0.0] * 6
    assert np.abs(suspension.step([0.0] * 6)[0]).max() < 0.004


def test_reset_relaxes_it() -> None:
    suspension = Suspension(GAINS, period=PERIOD)
    suspension.step([10.0] * 6)
    suspension.reset()
    assert suspension.state == ([0.0] * 6, [0.0] * 6)
