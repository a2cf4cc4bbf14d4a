"""Tests the PID against slip: it is python-control's sampling of the continuous law."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
from gains import PERIOD, SLIP

from hexapod_cosim.controller import SlipGains
from hexapod_cosim.controller.comply.slip_pid import SlipPid, missing_share, squeeze

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


def test_the_squeeze_is_what_is_left_beside_the_best_push_and_twist_of_the_body() -> None:
    """Compares with weighted least squares: the smallest sum of |e|^2/n over all pushes and twists
    shared by load, n (D + i w (p - c))/N.
    """
    generator = np.random.default_rng(5)
    for count in (3, 4, 6):
        push, feet = (
            generator.normal(size=count) + 1j * generator.normal(size=count) for _ in range(2)
        )
        normal = generator.uniform(0.5, 2.0, count)
        moved = normal * np.stack(
            [np.ones(count), 1j * np.ones(count), 1j * feet]
        )  # of a push along x, a push along y, and a twist
        weighted = moved / np.sqrt(normal)
        base, target = (
            np.concatenate([rows.real, rows.imag], axis=-1)
            for rows in (weighted, push / np.sqrt(normal))
        )
        expected = push - np.linalg.lstsq(base.T, target, rcond=None)[0] @ moved
        found = squeeze(push, normal, feet)
        np.testing.assert_allclose(found, expected, atol=1e-12)
        assert abs(found.sum()) < 1e-12
        assert abs((feet.conj() * found).imag.sum()) < 1e-12
        np.testing.assert_allclose(squeeze(found, normal, feet), found, atol=1e-12)
        np.testing.assert_allclose(
            squeeze(np.asarray(generator.normal(size=3) @ moved), normal, feet), 0.0, atol=1e-12
        )


def test_of_two_feet_only_what_is_along_their_line_is_squeeze_and_of_one_nothing() -> None:
    feet, normal = np.array([0.1 + 0.2j, -0.1 - 0.2j]), np.array([10.0, 20.0])
    line = (1.0 + 2.0j) / np.sqrt(5.0)
    np.testing.assert_allclose(
        squeeze(np.array([3.0 * line, -3.0 * line]), normal, feet),
        [3.0 * line, -3.0 * line],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        squeeze(np.array([1j * line, 2j * line]), normal, feet), 0.0, atol=1e-12
    )
    np.testing.assert_allclose(
        squeeze(np.array([1.0 + 1.0j]), normal[:1], feet[:1]), 0.0, atol=1e-12
    )


def test_feet_within_a_centimetre_take_no_moment_and_feet_without_load_keep_their_forces() -> None:
    for reach, left in ((0.0099, 1.0), (0.0101, 0.0)):
        feet = np.array([reach, -reach]) + 0.3j
        np.testing.assert_allclose(
            squeeze(np.array([1j, -1j]), np.ones(2), feet), [1j * left, -1j * left], atol=1e-12
        )
    np.testing.assert_array_equal(
        squeeze(np.array([1.0, 2.0j]), np.full(2, 0.4e-6), np.array([1.0, 0.0])), [1.0, 2.0j]
    )
    np.testing.assert_allclose(
        squeeze(np.array([1.0, 1.0]), np.full(2, 0.6e-6), np.array([1.0, 0.0])), 0.0, atol=1e-12
    )


def test_the_missing_share_of_the_planned_squeeze_does_not_depend_on_other_squeeze() -> None:
    draw = np.random.default_rng(8)
    planned, other = draw.normal(size=(2, 6)) + 1j * draw.normal(size=(2, 6))
    other = other - planned * np.vdot(planned, other).real / np.vdot(planned, planned).real
    for missing, share in ((0.0, 0.0), (0.4, 0.4), (1.0, 1.0), (1.5, 1.0), (-0.3, 0.0)):
        found = missing_share(other - missing * planned, planned)
        assert found == pytest.approx(share, abs=1e-12)
    assert missing_share(other, np.zeros(6, dtype=np.complex128)) == 0.0
