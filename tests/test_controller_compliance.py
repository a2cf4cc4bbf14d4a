"""What the measured forces do to the planned feet, checked on a model of a standing leg."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexapod_cosim.controller import LegSolver
from hexapod_cosim.controller.compliance import Compliance
from hexapod_cosim.controller.design import design_gains
from hexapod_cosim.controller.design.leg import extreme_directions, weight_share
from hexapod_cosim.controller.design.loops import creep_damping
from hexapod_cosim.models import load_robot

ROBOT = load_robot("athena")
PERIOD = 0.005  # s
GAINS = design_gains(ROBOT, PERIOD)
WEIGHT = ROBOT.total_mass * 9.81  # N
PLANE = LegSolver(ROBOT).forward(ROBOT.stance)[:, :2] @ np.array([1.0, 1.0j])
NOBODY, EVERYBODY = np.zeros(6, dtype=bool), np.ones(6, dtype=bool)
ROUND_OFF = 1e-9  # N
XY = np.array([1.0, 1.0j])  # columns x, y to x + i y


def make() -> Compliance:
    return Compliance(GAINS, weight=WEIGHT, centre=0j, period=PERIOD)


def standing_forces() -> np.ndarray:
    """(6, 3) every foot carries the same."""
    force = np.zeros((6, 3))
    force[:, 2] = WEIGHT / 6.0
    return force


def respond(laws: Compliance, force: np.ndarray, contact: np.ndarray, *, swinging: np.ndarray) -> None:
    """One period with feet in the stance and forces (6, 3)."""
    laws.plan(PLANE[None, :], swinging)
    laws.step(force[:, :2] @ XY, force[:, 2], contact)


def test_a_common_push_is_left_alone() -> None:
    laws, force = make(), standing_forces()
    force[:, 2] *= [0.5, 1.0, 1.5, 0.5, 1.0, 1.5]
    force[:, :2] = 0.3 * force[:, 2:] * [1.0, -0.5]
    respond(laws, force, EVERYBODY, swinging=NOBODY)
    assert np.abs(laws.squeeze).max() < ROUND_OFF


def test_squeezing_is_given_way_to_and_adds_up_to_nothing() -> None:
    laws, force = make(), standing_forces()
    force[0, 1], force[3, 1] = 2.0, -2.0
    for _ in range(10):
        respond(laws, force, EVERYBODY, swinging=NOBODY)
    np.testing.assert_allclose(laws.squeeze, [2j, 0, 0, -2j, 0, 0], atol=ROUND_OFF)
    assert laws.shift[0].imag > 0.0 > laws.shift[3].imag
    assert abs(laws.shift.sum()) < 1e-12


def test_yielding_takes_the_slip_from_a_leg_that_is_squeezed() -> None:
    """Quasi-static leg of the stiffest direction: x = u + f/K, f = -c (x' + drift), drift the creep that squeezing keeps up."""
    _, stiff = extreme_directions(ROBOT)
    load = weight_share(ROBOT)
    creep, drift = creep_damping(ROBOT, load), 0.01  # N s/m, m/s
    slips = []
    for sign in (0.0, 1.0, -1.0):
        laws, force = make(), standing_forces()
        force[:, 2] = [load, 0.0, load, 0.0, load, 0.0]
        f, shift_before, last = 0.0, 0.0, 0.0
        for _ in range(200):
            force[0, 0], force[2, 0] = f, -f
            respond(laws, force, force[:, 2] > 0.0, swinging=force[:, 2] == 0.0)
            shift = sign * laws.shift[0].real
            # backward Euler of f = -c ((u - u-)/h + (f - f-)/(K h) + drift)
            scale = creep / PERIOD
            f = (-scale * (shift - shift_before) + scale / stiff.stiffness * f - creep * drift) / (1.0 + scale / stiff.stiffness)
            f = float(np.clip(f, -0.7 * load, 0.7 * load))
            shift_before, last = shift, abs(f) / creep
        slips.append(last)
    without, yielding, resisting = slips
    assert yielding < 0.5 * without
    assert resisting > without


def test_the_shift_goes_when_the_load_is_planned_to_go() -> None:
    laws, force = make(), standing_forces()
    force[0, 1], force[3, 1] = 2.0, -2.0
    for _ in range(60):
        respond(laws, force, EVERYBODY, swinging=NOBODY)
    loaded, swinging = abs(laws.shift[0]), np.array([True, False, False, False, False, False])
    force[0, :2] = force[3, :2] = 0.0
    for _ in range(60):
        respond(laws, force, EVERYBODY, swinging=swinging)
    fade = np.exp(-60 * PERIOD / GAINS.slip.load_time)
    assert abs(laws.shift[0]) < 1.5 * fade * loaded  # the integral is still there: the foot has not left the ground
    assert abs(laws.pid.output[0]) > 0.5 * loaded


def test_the_measured_load_does_not_move_the_feet_sideways() -> None:
    laws, force = make(), standing_forces()
    force[0, 1], force[3, 1] = 2.0, -2.0
    other, heavier = make(), force.copy()
    heavier[:, 2] *= [1.3, 0.7, 1.3, 1.3, 0.7, 1.3]
    for _ in range(20):
        respond(laws, force, EVERYBODY, swinging=NOBODY)
        respond(other, heavier, EVERYBODY, swinging=NOBODY)
    np.testing.assert_allclose(other.shift, laws.shift, atol=1e-15)


def test_lift_off_resets_the_pid_of_that_leg_only() -> None:
    laws, force = make(), standing_forces()
    force[0, 1], force[3, 1] = 2.0, -2.0
    for _ in range(40):
        respond(laws, force, EVERYBODY, swinging=NOBODY)
    swinging = np.array([True, False, False, False, False, False])
    respond(laws, force, EVERYBODY, swinging=swinging)
    assert laws.pid.state[0][2] != 0.0  # planned to swing, but still on the ground
    force[0] = 0.0
    respond(laws, force, ~swinging, swinging=swinging)
    assert laws.pid.state[0][2] == 0.0
    assert laws.pid.state[3][2] != 0.0


@pytest.mark.parametrize("standing", ["111111", "101010", "010101", "110111", "101101"])
def test_the_shares_carry_the_weight_about_the_centre_of_mass(standing: str) -> None:
    laws = Compliance(GAINS, weight=WEIGHT, centre=0.01 - 0.005j, period=PERIOD)
    swinging = np.array([flag == "0" for flag in standing])
    respond(laws, standing_forces() * [0.0, 0.0, 1.0], ~swinging, swinging=swinging)
    assert laws.shares.sum() == pytest.approx(WEIGHT)
    assert (laws.shares[0] @ PLANE) / WEIGHT == pytest.approx(0.01 - 0.005j)
    assert not laws.shares[0, swinging].any()


def test_feet_on_one_line_share_the_weight_evenly() -> None:
    laws = make()
    swinging = np.array([True, False, True, True, False, True])
    respond(laws, standing_forces() * [0.0, 0.0, 1.0], ~swinging, swinging=swinging)
    np.testing.assert_allclose(laws.shares[0, [1, 4]], WEIGHT / 2.0)


def test_at_the_preload_the_suspension_rests_and_beyond_it_the_foot_yields_upwards() -> None:
    laws, force = make(), standing_forces()
    force[:, 2] *= GAINS.suspension.preload
    respond(laws, force, EVERYBODY, swinging=NOBODY)
    assert np.abs(laws.lift).max() < 1e-15
    force[2, 2] += 5.0
    respond(laws, force, EVERYBODY, swinging=NOBODY)
    assert laws.lift[2] > 0.0


def test_the_preload_makes_good_the_servos_sag() -> None:
    jacobian = LegSolver(ROBOT).jacobian(ROBOT.stance)
    load = WEIGHT / 6.0
    sag = (np.einsum("lj,lj->l", jacobian[:, 2], jacobian[:, 2]) / ROBOT.servo.kp) * load
    laws, force = make(), standing_forces()
    for _ in range(2000):
        respond(laws, force, EVERYBODY, swinging=NOBODY)
    np.testing.assert_allclose(-laws.lift, sag, rtol=1e-6)


def test_a_swinging_foot_is_not_pushed() -> None:
    laws, force = make(), np.zeros((6, 3))
    for _ in range(100):
        respond(laws, force, NOBODY, swinging=EVERYBODY)
    assert not laws.lift.any()
    assert not laws.shift.any()


def test_rates_are_those_of_the_corrections() -> None:
    laws, generator = make(), np.random.default_rng(1)
    for _ in range(50):
        force = standing_forces() + generator.normal(size=(6, 3))
        before = laws.shift.copy()
        respond(laws, force, EVERYBODY, swinging=NOBODY)
        np.testing.assert_allclose(laws.shift_rate, (laws.shift - before) / PERIOD, atol=1e-12)


def test_gains_without_integral_or_proportional_part_leave_the_feet() -> None:
    quiet = replace(GAINS, slip=replace(GAINS.slip, kp=0.0, ki=0.0, kd=0.0))
    laws, force = Compliance(quiet, weight=WEIGHT, centre=0j, period=PERIOD), standing_forces()
    force[0, 1], force[3, 1] = 2.0, -2.0
    respond(laws, force, EVERYBODY, swinging=NOBODY)
    assert not laws.shift.any()
