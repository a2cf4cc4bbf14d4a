"""The PID on the tangential force: python-control's system, its clamp, its memory."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest

from hexapod_cosim.controller import SlipGains, SlipPid
from hexapod_cosim.controller.design.laws import sampled_slip_law, slip_law

PERIOD = 0.005  # s
GAINS = SlipGains(kp=2e-4, ki=5e-3, kd=3e-6, derivative_time=0.01, filter_time=0.012, load_time=0.02, tracking_time=0.04, limit=1.0)
STEPS = 200
ROUND_OFF = 1e-12  # m


def random_forces() -> np.ndarray:
    """(steps, 6) forces x + i y [N]."""
    generator = np.random.default_rng(5)
    return generator.normal(size=(STEPS, 6)) * 3.0 + 1j * generator.normal(size=(STEPS, 6))


def outputs(gains: SlipGains, forces: np.ndarray) -> np.ndarray:
    pid = SlipPid(gains, period=PERIOD)
    return np.array([pid.step(force.tolist()) for force in forces])


def simulated(system: control.StateSpace, force: np.ndarray) -> np.ndarray:
    found: np.ndarray = np.atleast_2d(control.forced_response(system, np.arange(STEPS) * PERIOD, force).outputs)[0]
    return found


@pytest.mark.parametrize("part", ["real", "imag"])
def test_the_law_is_python_controls_tustin_sampling_of_its_transfer_function(part: str) -> None:
    forces = random_forces()
    whole = control.ss(control.sample_system(slip_law(GAINS), PERIOD, method="bilinear"))
    mine = getattr(outputs(GAINS, forces), part)
    for leg in range(6):
        np.testing.assert_allclose(mine[:, leg], simulated(whole, getattr(forces, part)[:, leg]), atol=1e-9)  # tf of order 3


def test_the_designs_system_is_the_law_that_runs() -> None:
    forces = random_forces()
    np.testing.assert_allclose(
        outputs(GAINS, forces)[:, 2].real, simulated(sampled_slip_law(GAINS, period=PERIOD), forces[:, 2].real), atol=ROUND_OFF
    )


def test_the_foot_gives_way_in_the_direction_of_the_force() -> None:
    pid = SlipPid(GAINS, period=PERIOD)
    for _ in range(20):
        shift = np.array(pid.step([3.0 - 4.0j] * 6))
    np.testing.assert_allclose(shift / np.abs(shift), 0.6 - 0.8j, atol=1e-12)


def test_the_shift_is_clamped_in_length_with_its_direction_kept() -> None:
    pid = SlipPid(replace(GAINS, limit=0.01), period=PERIOD)
    for _ in range(500):
        shift = pid.step([30.0 + 40.0j] * 6)
    np.testing.assert_allclose(shift, 0.006 + 0.008j, atol=ROUND_OFF)


def test_back_calculation_frees_the_shift_soon_after_the_force_turns() -> None:
    bounded, naive = (
        SlipPid(replace(GAINS, limit=0.005), period=PERIOD),
        SlipPid(replace(GAINS, limit=0.005, tracking_time=1e9), period=PERIOD),
    )
    for pid in (bounded, naive):
        for _ in range(600):
            pid.step([5.0 + 0j] * 6)
    counts = []
    for pid in (bounded, naive):
        count = 0
        while pid.step([-5.0 + 0j] * 6)[0].real > 0.0 and count < 2000:
            count += 1
        counts.append(count)
    recovery = 0.25 / PERIOD  # the limit alone takes 0.005/(0.005 x 5) = 0.2 s to integrate away
    assert counts[0] < recovery
    assert counts[1] > 2.0 * recovery


def test_reset_forgets_the_legs_it_is_told_and_no_other() -> None:
    pid, fresh = SlipPid(GAINS, period=PERIOD), SlipPid(GAINS, period=PERIOD)
    for force in random_forces().tolist():
        pid.step(force)
    kept, gone = pid.state, [True, False, False, False, True, False]
    pid.reset(gone)
    assert not np.array(pid.state)[gone].any()
    assert not np.array(pid.output)[gone].any()
    assert [pid.state[leg] for leg in (1, 2, 3, 5)] == [kept[leg] for leg in (1, 2, 3, 5)]
    force = random_forces()[0].tolist()
    np.testing.assert_array_equal(np.array(pid.step(force))[gone], np.array(fresh.step(force))[gone])


def test_no_force_no_shift() -> None:
    assert not outputs(GAINS, np.zeros((STEPS, 6), dtype=complex)).any()
