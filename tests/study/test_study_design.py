"""The points of a study: grids, strata of drawn designs, and independence of the order of calls."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from scipy import stats
from studies import study_of

from hexapod_cosim.extensions.study.factors import at_quantile
from hexapod_cosim.extensions.study.orders import count_points, count_runs, points_of, sweep_orders
from hexapod_cosim.extensions.study.records import (
    INTEGERS,
    LOGUNIFORM,
    NORMAL,
    UNIFORM,
    VALUES,
    Factor,
    Study,
)

TWO = {"friction.mu": {"uniform": [0.0, 1.0]}, "command.vx": {"uniform": [0.0, 1.0]}}
STRATA = 64


def drawn(
    design: str, *, points: int = STRATA, seed: int = 0, factors: Mapping[str, Any] = TWO
) -> Study:
    return study_of({"design": design, "points": points, "seed": seed, "factors": factors})


def table(study: Study) -> np.ndarray[Any, Any]:
    return np.array(points(study), dtype=np.float64)


def points(study: Study) -> list[tuple[Any, ...]]:
    return list(map(points_of(study), range(count_points(study))))


def test_a_grid_is_the_product_of_its_factors_the_last_fastest() -> None:
    factors = {
        "friction.mu": [0.3, 0.6],
        "command.vx": {"linspace": [0.0, 0.1, 3]},
        "gait.name": ["tripod", "wave"],
    }
    study = study_of({"factors": factors})
    expected = list(itertools.product([0.3, 0.6], [0.0, 0.05, 0.1], ["tripod", "wave"]))
    assert points(study) == expected


def test_a_list_takes_the_factors_side_by_side() -> None:
    # in a list values may be repeated
    factors = {"friction.mu": [0.3, 0.6, 0.3], "gait.name": ["tripod", "wave", "wave"]}
    study = study_of({"design": "list", "factors": factors})
    assert points(study) == [(0.3, "tripod"), (0.6, "wave"), (0.3, "wave")]


@pytest.mark.parametrize("design", ["latin_hypercube", "sobol"])
def test_every_stratum_of_every_factor_has_one_point(design: str) -> None:
    strata = np.sort((table(drawn(design)) * STRATA).astype(int), axis=0)
    assert np.array_equal(strata, np.repeat(np.arange(STRATA)[:, None], 2, axis=1))


def test_sobol_points_fill_squares_too_and_random_ones_do_not() -> None:
    cells = {
        design: len({tuple(cell) for cell in (table(drawn(design)) * 8).astype(int).tolist()})
        for design in ("sobol", "random")
    }
    assert cells["sobol"] == STRATA
    assert cells["random"] < STRATA


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_points_depend_on_the_seed_only_and_not_on_the_order_of_calls(design: str) -> None:
    whole = table(drawn(design))
    again = points_of(drawn(design))
    for index in (40, 3, 3, 63, 0, 41):
        assert tuple(whole[index]) == again(index)
    assert not np.array_equal(whole, table(drawn(design, seed=1)))


@pytest.mark.parametrize(
    ("factor", "law"),
    [
        (Factor(name="x", kind=UNIFORM, low=2.0, high=5.0), stats.uniform(2.0, 3.0)),
        (Factor(name="x", kind=LOGUNIFORM, low=0.1, high=10.0), stats.loguniform(0.1, 10.0)),
        (Factor(name="x", kind=NORMAL, low=1.0, high=0.5), stats.norm(1.0, 0.5)),
    ],
)
def test_quantiles_are_those_of_the_distribution(factor: Factor, law: Any) -> None:
    for share in (0.0, 0.01, 0.3, 0.5, 0.99):
        value = at_quantile(factor, share)
        assert np.isfinite(float(value))
        assert law.cdf(value) == pytest.approx(share, abs=1e-12)


def test_values_and_integers_are_equally_likely_and_the_ends_are_reached() -> None:
    shares = (np.arange(300) + 0.5) / 300
    for factor, count in (
        (Factor(name="x", kind=VALUES, values=("a", "b", "c")), 3),
        (Factor(name="x", kind=INTEGERS, low=2.0, high=7.0), 6),
    ):
        found = [at_quantile(factor, share) for share in [*shares, 1.0]]
        assert [found[:-1].count(value) for value in dict.fromkeys(found)] == [300 // count] * count
        assert isinstance(found[0], int | str)


def test_runs_are_points_then_seeds_then_controls() -> None:
    study = study_of({"factors": {"friction.mu": [0.3, 0.6]}, "seeds": {"first": 7, "count": 2}})
    orders = list(sweep_orders(study, range(count_runs(study))))
    expected = itertools.product([0.3, 0.6], [7, 8], ["kinematic", "compliant"])
    assert [(order.values[0], order.seed, order.control) for order in orders] == list(expected)
    assert [order.run for order in orders] == list(range(8))
    assert list(sweep_orders(study, [1, 5])) == [orders[1], orders[5]]


def test_scenarios_are_a_factor_too() -> None:
    study = study_of({"factors": {"scenario": ["walk_flat", "turn"]}, "controls": ["kinematic"]})
    assert [order.case for order in sweep_orders(study, range(2))] == ["walk_flat", "turn"]
