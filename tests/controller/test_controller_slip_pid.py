"""Tests the PID against slip: it is python-control's sampling of the continuous law."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
from gains import PERIOD

from hexapod_cosim.controller import SlipGains
from hexapod_cosim.controller.comply.slip_pid import SlipPid

SLIP = SlipGains(
    kp=0.2,
    ki=20.0,
    kd=0.0,
    derivative_time=0.01,
    filter_time=0.01,
    load_time=0.03,
    tracking_time=0.02,
    limit=1.0,
)
STATES = ("force", "smooth", "integral", "slope")
FREQUENCIES = np.geomspace(0.1, 0.99 * np.pi / PERIOD, 50)  # rad/s
RELATIVE = 1e-9  # relative to the response: round-off of python-control's polynomials of order 3
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
    return (gains.kp + gains.ki / s + gains.kd * s / (gains.derivative_time * s + 1.0)) / (
        gains.filter_time * s + 1.0
    )


def running(gains: SlipGains, *, period: float = PERIOD) -> control.StateSpace:
    """Returns the implemented law as a python-control system, from one step for each state and one
    for a force.
    """
    columns = []
    for cause in (*STATES, "input"):
        pid = SlipPid(gains, period=period)
        pid.restore({name: np.full(6, complex(name == cause)) for name in STATES})
        answer = pid.step(np.full(6, complex(cause == "input")))
        columns.append([answer[0].real, *(getattr(pid, name)[0].real for name in STATES)])
    matrix = np.array(columns).T
    return control.ss(matrix[1:, :4], matrix[1:, 4:], matrix[:1, :4], matrix[0, 4], period)


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
    np.testing.assert_allclose(
        response(running(GAINS[name]), z),
        response(continuous(GAINS[name]), 1j * warped),
        rtol=RELATIVE,
    )


def test_a_steady_force_is_answered_by_kp_and_an_integral_that_lacks_the_filters_lag() -> None:
    """After the filter has settled, u = kp f + ki f (t - T_f): the trapezoidal rule integrates the
    area exactly.
    """
    pid, force, count = SlipPid(SLIP, period=PERIOD), 3.0, 400
    for _ in range(count):
        answer = pid.step(np.full(6, force + 0j))
    lasted = (
        count - 0.5
    ) * PERIOD  # a force that is first seen at a step counts from half a period before it
    assert answer[0] == pytest.approx(
        force * (SLIP.kp + SLIP.ki * (lasted - SLIP.filter_time)), rel=1e-9
    )
