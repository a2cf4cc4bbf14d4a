"""Numbers the runs of a study and makes the order of each from its number.

Points that are drawn one by one are not in memory as a whole; those of Latin hypercubes and Sobol
sequences are, with 8 bytes per point and factor.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator
from itertools import product
from typing import Any

import numpy as np

from hexapod_cosim.extensions.study.factors import at_quantile
from hexapod_cosim.extensions.study.records import (
    DRAWN,
    GRID,
    LATIN_HYPERCUBE,
    RANDOM,
    SCENARIO_FACTOR,
    SOBOL,
    Order,
    Study,
    Value,
)
from hexapod_cosim.models.arrays import Array

STREAM = 2  # of random numbers of the study's seed; scenarios use the streams 0 and 1


def points_of(study: Study) -> Callable[[int], tuple[Value, ...]]:
    """Returns a function from a point's number to the values of the factors at it.

    In a grid the last factor changes fastest.
    """
    factors, shape = study.factors, [len(factor.values) for factor in study.factors]
    if study.design in DRAWN:
        shares = _shares(study)
        return lambda index: tuple(map(at_quantile, factors, shares(index).tolist()))

    def point(index: int) -> tuple[Value, ...]:
        grid = study.design == GRID and len(factors) > 0
        places: Any = np.unravel_index(index, shape) if grid else (index,) * len(factors)
        return tuple(factor.values[place] for factor, place in zip(factors, places, strict=True))

    return point


def _shares(study: Study) -> Callable[[int], Array]:
    """Returns a function from a point's number to the quantiles (factors,) of its values."""
    from scipy.stats import qmc  # noqa: PLC0415  slow to import, and workers draw no points

    size, seed = len(study.factors), np.random.default_rng([study.seed, STREAM])
    if study.design == RANDOM:
        return lambda index: np.random.default_rng([study.seed, STREAM, index]).random(size)
    sampler = {LATIN_HYPERCUBE: qmc.LatinHypercube, SOBOL: qmc.Sobol}[study.design]
    with warnings.catch_warnings():  # of Sobol points that are no power of two
        warnings.simplefilter("ignore", UserWarning)
        drawn: Array = sampler(size, seed=seed).random(study.points)
    return lambda index: drawn[index]


def sweep_orders(study: Study, runs: Iterable[int]) -> Iterator[Order]:
    """Yields the orders of runs, whose numbers should ascend, of a study without an optimiser.

    Runs are numbered by point, then seed, then control.
    """
    point_at, known, case = points_of(study), -1, ""
    values: tuple[Value, ...] = ()
    names, first = [factor.name for factor in study.factors], next(iter(study.cases))
    for run in runs:
        pair, control = divmod(run, len(study.controls))
        point, seed = divmod(pair, len(study.seeds))
        if point != known:
            known, values = point, point_at(point)
            case = str(dict(zip(names, values, strict=True)).get(SCENARIO_FACTOR, first))
        yield Order(
            run=run,
            point=point,
            case=case,
            values=values,
            seed=study.seeds[seed],
            control=study.controls[control],
        )


def trial_orders(
    study: Study, point: int, values: tuple[Value | None, ...], *, held_out: bool = False
) -> list[Order]:
    """Returns the runs of an optimisation at a point: a trial, or settings on held-out runs.

    Points are the trials, then the unchanged settings, then both settings that are held out.
    """
    asked = study.optimise
    assert asked is not None
    part = asked.held_out if held_out else asked.training
    before = asked.trained - (asked.trials + 1) * part.runs if held_out else 0
    return [
        Order(run=run, point=point, case=case, values=values, seed=seed, control=asked.control)
        for run, (case, seed) in enumerate(
            product(part.cases, part.seeds), before + point * part.runs
        )
    ]


def count_points(study: Study) -> int:
    """Returns the number of points of a study without an optimiser."""
    lengths = [len(factor.values) for factor in study.factors]
    grid = math.prod(lengths if study.design == GRID else lengths[:1])
    return study.points if study.design in DRAWN else grid


def count_runs(study: Study) -> int:
    """Returns the number of runs of a study."""
    if study.optimise is not None:
        return study.optimise.count
    return count_points(study) * len(study.seeds) * len(study.controls)
