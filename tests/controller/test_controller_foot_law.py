"""Tests that the laws of a foot are the sum of its parts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gains import PERIOD, SLIP, make_gains

from hexapod_cosim.controller.comply.foot_law import FootLaw
from hexapod_cosim.controller.comply.slip_pid import SlipPid
from hexapod_cosim.controller.comply.suspension import discretise
from hexapod_cosim.models import load_robot

GAINS = replace(make_gains(load_robot("athena")), slip=replace(SLIP, kd=0.002))
ROUND_OFF = 1e-12  # N, m; sums of a few products of order 1 to 10
STEPS = 60


def inputs(seed: int = 5) -> np.ndarray:
    """Returns forces x, y, z [N] and loads [1] of the feet, shape (steps, 6, 4)."""
    generator = np.random.default_rng(seed)
    return np.asarray(generator.normal(size=(STEPS, 6, 4)) * [3.0, 3.0, 10.0, 0.5])


def stepped(law: FootLaw, given: np.ndarray) -> np.ndarray:
    """Returns answer x and y, deflection, its rate and load (6, 5) after a step."""
    law.step(given[:, 0] + 1j * given[:, 1], given[:, 2], given[:, 3])
    return np.column_stack([law.answer.real, law.answer.imag, law.deflection, law.rate, law.load])


@pytest.mark.parametrize("axis", [0, 1])
def test_each_direction_is_the_pid_by_itself(axis: int) -> None:
    law, alone = FootLaw(GAINS, period=PERIOD), SlipPid(GAINS.slip, period=PERIOD)
    for given in inputs():
        found = stepped(law, given)
        np.testing.assert_allclose(
            found[:, axis], alone.step(given[:, axis] + 0j).real, atol=ROUND_OFF
        )


def test_the_deflection_is_the_suspension_by_itself() -> None:
    law, (a, b), state = (
        FootLaw(GAINS, period=PERIOD),
        discretise(GAINS.suspension, period=PERIOD),
        np.zeros((6, 2)),
    )
    for given in inputs():
        found = stepped(law, given)
        state = state @ a.T + given[:, 2:3] * b
        np.testing.assert_allclose(found[:, 2:4], state, atol=ROUND_OFF)


def test_the_load_follows_with_its_time_constant() -> None:
    law = FootLaw(GAINS, period=PERIOD)
    for k in range(1, STEPS):
        found = stepped(law, np.full((6, 4), 0.7))
        np.testing.assert_allclose(
            found[:, 4], 0.7 * (1.0 - math.exp(-k * PERIOD / GAINS.slip.load_time)), atol=ROUND_OFF
        )


@pytest.mark.parametrize("leg", range(6))
def test_feet_know_nothing_of_each_other(leg: int) -> None:
    law, other = FootLaw(GAINS, period=PERIOD), FootLaw(GAINS, period=PERIOD)
    rest = np.arange(6) != leg
    for given, changed in zip(inputs(), inputs(8), strict=True):
        row, same = stepped(law, given), stepped(other, np.where(rest[:, None], changed, given))
        np.testing.assert_array_equal(row[leg], same[leg])
    assert (row[rest] != same[rest]).any(axis=1).all()


def test_directions_are_alike_and_do_not_mix() -> None:
    law, swapped = FootLaw(GAINS, period=PERIOD), FootLaw(GAINS, period=PERIOD)
    for given in inputs():
        found, other = stepped(law, given), stepped(swapped, given[:, [1, 0, 2, 3]])
        np.testing.assert_allclose(other[:, :2], found[:, [1, 0]], atol=ROUND_OFF)
    law.reset()
    for given in inputs():
        found = stepped(law, given * [0.0, 1.0, 1.0, 1.0])
    assert not found[:, 0].any()
    assert found[:, 1].all()


def test_a_step_is_linear_and_rest_stays_rest() -> None:
    laws = [FootLaw(GAINS, period=PERIOD) for _ in range(3)]
    for one, two in zip(inputs(), inputs(8), strict=True):
        found = [
            stepped(law, given)
            for law, given in zip(laws, (one, two, one + 2.0 * two), strict=True)
        ]
        np.testing.assert_allclose(found[2], found[0] + 2.0 * found[1], atol=1e-9)
    laws[0].reset()
    assert not stepped(laws[0], np.zeros((6, 4))).any()


def test_what_is_set_between_steps_works_on() -> None:
    law = FootLaw(GAINS, period=PERIOD)
    law.pid.integral = np.array([0.0, 0.0, 0.0, 2.0j, 0.0, 0.0])
    assert stepped(law, np.zeros((6, 4)))[3, 1] == 2.0


def test_a_saved_law_goes_on_bit_for_bit() -> None:
    law = FootLaw(GAINS, period=PERIOD)
    given = inputs()
    for row in given[:30]:
        stepped(law, row)
    state = law.save()
    first = [stepped(law, row) for row in given[30:]]
    law.restore(state)
    np.testing.assert_array_equal([stepped(law, row) for row in given[30:]], first)
