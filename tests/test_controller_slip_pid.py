"""The PID against slip: python-control's sampling of the continuous law."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
from gains import PERIOD, SLIP

from hexapod_cosim.controller import SlipGains
from hexapod_cosim.controller.slip_pid import system

FORCE = 4  # of the row that goes in, behind the states
ANSWER, STATES = 0, slice(1, 5)  # of the row that comes out
FREQUENCIES = np.geomspace(0.1, 0.99 * np.pi / PERIOD, 50)  # rad/s
RELATIVE = 1e-9  # of the response: round-off of python-control's polynomials of order 3
WITH_SLOPE = replace(SLIP, kd=0.003, derivative_time=0.007)
GAINS = {
    "pi": SLIP,
    "pid": WITH_SLOPE,
    "p": replace(SLIP, ki=0.0),
    "i": replace(SLIP, kp=0.0),
    "slow": replace(WITH_SLOPE, filter_time=0.1),
}


def continuous(gains: SlipGains) -> control.TransferFunction:
    s = control.tf("s")
    return (gains.kp + gains.ki / s + gains.kd * s / (gains.derivative_time * s + 1.0)) / (gains.filter_time * s + 1.0)


def running(gains: SlipGains, *, period: float = PERIOD) -> control.StateSpace:
    """The law that runs, as python-control sees it: rows that act from the right, transposed."""
    matrix = system(gains, period=period).T
    a, b = matrix[STATES, :FORCE], matrix[STATES, FORCE:]
    return control.ss(a, b, matrix[ANSWER : ANSWER + 1, :FORCE], matrix[ANSWER, FORCE], period)


def response(law: control.LTI, at: np.ndarray) -> np.ndarray:
    return np.asarray(law(at, squeeze=True))


@pytest.mark.parametrize("name", GAINS)
@pytest.mark.parametrize("period", [0.001, PERIOD, 0.02])
def test_the_law_is_tustins_sampling_of_its_transfer_function(name: str, period: float) -> None:
    law, frequency = GAINS[name], FREQUENCIES * PERIOD / period
    z = np.exp(1j * frequency * period)
    sampled = response(control.sample_system(continuous(law), period, method="bilinear"), z)
    np.testing.assert_allclose(response(running(law, period=period), z), sampled, rtol=RELATIVE)


@pytest.mark.parametrize("name", GAINS)
def test_its_frequency_response_is_the_continuous_one_at_the_warped_frequency(name: str) -> None:
    z = np.exp(1j * FREQUENCIES * PERIOD)
    warped = 2.0 / PERIOD * np.tan(FREQUENCIES * PERIOD / 2.0)
    np.testing.assert_allclose(response(running(GAINS[name]), z), response(continuous(GAINS[name]), 1j * warped), rtol=RELATIVE)


def test_a_steady_force_is_answered_by_kp_and_an_integral_that_lacks_the_filters_lag() -> None:
    """u = kp f + ki f (t - T_f) once the filter has settled: the trapezoid loses nothing of the area."""
    matrix, row, force, count = system(SLIP, period=PERIOD), np.zeros(5), 3.0, 400
    for _ in range(count):
        row = np.append(row[STATES], force) @ matrix
    lasted = (count - 0.5) * PERIOD  # a force first seen at a step counts from half a period before it
    assert row[ANSWER] == pytest.approx(force * (SLIP.kp + SLIP.ki * (lasted - SLIP.filter_time)), rel=1e-9)
