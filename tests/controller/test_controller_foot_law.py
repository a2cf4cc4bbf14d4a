"""The laws of a foot as one product of matrices: its parts, and nothing but its parts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gains import PERIOD, SLIP, make_gains

from hexapod_cosim.controller import slip_pid, suspension
from hexapod_cosim.controller.foot_law import FootLaw, law_matrix
from hexapod_cosim.models import load_robot

GAINS = replace(make_gains(load_robot("athena")), slip=replace(SLIP, kd=0.002))
ROUND_OFF = 1e-12  # N, m: of sums of a few products of order 1 to 10
STEPS = 60


def inputs(seed: int = 5) -> np.ndarray:
    """(steps, 6, 4) forces x, y, z [N] and loads [1]."""
    generator = np.random.default_rng(seed)
    return np.asarray(generator.normal(size=(STEPS, 6, 4)) * [3.0, 3.0, 10.0, 0.5])


def stepped(law: FootLaw, given: np.ndarray) -> np.ndarray:
    law.inputs[...] = given
    law.step()
    return law.row.copy()


@pytest.mark.parametrize("axis", [0, 1])
def test_each_direction_is_the_pid_by_itself(axis: int) -> None:
    law, alone, states = (
        FootLaw(GAINS, period=PERIOD),
        slip_pid.system(GAINS.slip, period=PERIOD),
        np.zeros((6, 4)),
    )
    for given in inputs():
        stepped(law, given)
        found = np.column_stack([states, given[:, axis]]) @ alone
        states = found[:, 1:]
        np.testing.assert_allclose(law.answer[:, axis], found[:, 0], atol=ROUND_OFF)
        np.testing.assert_allclose(law.integral[:, axis], found[:, 3], atol=ROUND_OFF)


def test_the_deflection_is_the_suspension_by_itself() -> None:
    law, (a, b), state = (
        FootLaw(GAINS, period=PERIOD),
        suspension.discretise(GAINS.suspension, period=PERIOD),
        np.zeros((6, 2)),
    )
    for given in inputs():
        stepped(law, given)
        state = state @ a.T + given[:, 2:3] * b
        np.testing.assert_allclose(
            np.column_stack([law.deflection, law.rate]), state, atol=ROUND_OFF
        )


def test_the_load_follows_with_its_time_constant() -> None:
    law = FootLaw(GAINS, period=PERIOD)
    for k in range(1, STEPS):
        stepped(law, np.full((6, 4), 0.7))
        np.testing.assert_allclose(
            law.load, 0.7 * (1.0 - math.exp(-k * PERIOD / GAINS.slip.load_time)), atol=ROUND_OFF
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
        stepped(law, given)
        stepped(swapped, given[:, [1, 0, 2, 3]])
        np.testing.assert_allclose(swapped.answer, law.answer[:, ::-1], atol=ROUND_OFF)
        stepped(law, given * [0.0, 1.0, 1.0, 1.0])
        stepped(swapped, given[:, [1, 0, 2, 3]] * [1.0, 0.0, 1.0, 1.0])
    law.reset()
    for given in inputs():
        stepped(law, given * [0.0, 1.0, 1.0, 1.0])
    assert not law.answer[:, 0].any()


def test_a_step_is_linear_and_rest_stays_rest() -> None:
    rows = np.random.default_rng(1).normal(size=(2, 18))
    matrix = law_matrix(GAINS, period=PERIOD)
    assert not (np.zeros(18) @ matrix).any()
    law = FootLaw(GAINS, period=PERIOD)
    law.row[0], law.row[1], law.row[2] = rows[0], rows[1], rows[0] + 2.0 * rows[1]
    law.step()
    np.testing.assert_allclose(law.row[2], law.row[0] + 2.0 * law.row[1], atol=1e-9)
    assert not law.inputs.any()


def test_what_the_views_change_works_on() -> None:
    law = FootLaw(GAINS, period=PERIOD)
    law.integral[3, 1] = 2.0
    stepped(law, np.zeros((6, 4)))
    assert law.answer[3, 1] == 2.0
    law.reset()
    assert not stepped(law, np.zeros((6, 4))).any()
