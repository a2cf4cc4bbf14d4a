"""Tests at what height a foot is expected to meet the ground.

A height that all feet have in common, or that one foot met twice, does not count as a bump.
"""

from __future__ import annotations

import numpy as np
import pytest
from gains import PERIOD
from standing import WEIGHT, Laws, make_laws, plan, squeezing

from hexapod_cosim.controller import Parts
from hexapod_cosim.controller.sense.landing import Landings

LOW = np.zeros(6)
ALL, NONE = np.ones(6, dtype=bool), np.zeros(6, dtype=bool)
FIRST = np.array([True, False, True, False, True, False])  # a tripod
ONLY_TOUCHDOWN = Parts(support=False, fallback=False)


def step(landings: Landings, swinging: np.ndarray, heights: list[float]) -> None:
    """Takes a step in which these legs swing and land at heights [m], while the others stand."""
    landings.look(~swinging, np.full(6, 0.03), swinging)
    landings.look(ALL, np.array(heights), swinging)
    landings.look(ALL, LOW, NONE)


def test_feet_are_expected_as_low_as_the_lowest_of_the_others() -> None:
    landings = Landings()
    step(landings, FIRST, [0.012, 0.0, 0.010, 0.0, 0.014, 0.0])
    step(landings, ~FIRST, [0.0, 0.015, 0.0, 0.011, 0.0, 0.013])
    np.testing.assert_allclose(
        landings.expected(ALL, LOW, NONE), [0.010, 0.010, 0.011, 0.010, 0.010, 0.010]
    )


def test_a_foot_is_expected_where_it_came_down_a_step_before() -> None:
    landings = Landings()
    for swinging in (FIRST, ~FIRST):
        step(landings, swinging, [0.0] * 6)
    np.testing.assert_array_equal(landings.expected(ALL, LOW, NONE), 0.0)
    step(landings, FIRST, [0.012, 0.0, 0.0, 0.0, 0.0, 0.0])
    # the first landing at this height counts as a bump
    assert landings.expected(ALL, LOW, NONE)[0] == 0.0
    step(landings, FIRST, [0.012, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(landings.expected(ALL, LOW, NONE), [0.012, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(("above", "early"), [(0.0019, False), (0.0021, True)])
def test_a_foot_is_early_that_meets_the_ground_two_millimetres_above_where_it_is_expected(
    above: float, early: bool
) -> None:
    """All feet have landed at 10 mm before; now foot 0 meets a bump."""
    landings = Landings()
    for swinging in (FIRST, ~FIRST, FIRST, ~FIRST):
        step(landings, swinging, [0.010] * 6)
    expected = landings.expected(ALL, LOW, NONE)
    step(landings, np.arange(6) == 0, [0.010 + above, *[0.0] * 5])
    np.testing.assert_array_equal(landings.early(expected, np.full(6, 0.03)), [early, *[False] * 5])


@pytest.mark.parametrize(("above", "early"), [(0.0019, False), (0.0021, True)])
def test_a_foot_is_early_only_while_its_path_is_two_millimetres_above_the_common_ground(
    above: float, early: bool
) -> None:
    landings = Landings()
    for swinging in (FIRST, ~FIRST, FIRST, ~FIRST):
        step(landings, swinging, [0.010] * 6)
    expected = landings.expected(ALL, LOW, NONE)
    step(landings, np.arange(6) == 0, [0.020, *[0.0] * 5])
    assert landings.early(expected, np.full(6, 0.010 + above))[0] == early


def walk(laws: Laws, ground: np.ndarray, steps: int) -> list[np.ndarray]:
    """Walks with two alternating tripods whose feet come down from 25 mm at 0.25 m/s onto ground of
    these heights [m] (6,).

    Returns the offsets at the end of each step.
    """
    found = []
    for k in range(steps):
        swinging = FIRST if k % 2 == 0 else ~FIRST
        standing = "".join("0" if swings else "1" for swings in swinging)
        for height in np.arange(0.025, -1e-9, -0.25 * PERIOD):
            force = squeezing(0.0)
            force[swinging & (height > ground), 2] = 0.0
            force[swinging & (height <= ground), 2] = 0.05 * WEIGHT
            plan(laws, standing=standing, height=height, rise=-0.25)
            laws.feel(force)
        found.append(laws.touchdown.offset)
    return found


def test_ground_that_all_feet_meet_early_raises_none_and_a_bump_raises_the_foot_on_it() -> None:
    sunk, bump = np.full(6, 0.012), np.array([0.012, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert np.abs(walk(make_laws(parts=ONLY_TOUCHDOWN), sunk, 8)).max() < 1e-12
    offsets = walk(make_laws(parts=ONLY_TOUCHDOWN), bump, 1)[0]
    assert 0.005 < offsets[0] < 0.012
    assert not offsets[1:].any()
