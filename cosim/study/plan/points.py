"""Computes the points of a study from their numbers, without a list of all points in memory.

The Latin hypercube is the exception: it is held as a whole, with 8 bytes per point and factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from scipy.stats import qmc

from hexapod_cosim.cosim.study.plan.factors import at_quantile
from hexapod_cosim.cosim.study.plan.records import (
    DRAWN,
    GRID,
    LATIN_HYPERCUBE,
    LIST,
    RANDOM,
    SCENARIO_FACTOR,
    SOBOL,
    VALUES,
    Factor,
    Order,
    Study,
    StudyError,
    Value,
)

MAX_STRATA = 10**7  # of all factors of a Latin hypercube
STREAM = 2  # of random numbers of the study's seed; scenarios use the streams 0 and 1
Shares = Callable[[int], np.ndarray[tuple[int], np.dtype[np.float64]]]


class Design:
    """The points of a study."""

    def __init__(self, study: Study) -> None:
        self._study, self.count = study, _count(study)
        self._shares = _shares(study)

    def point(self, index: int) -> tuple[Value, ...]:
        """Returns the values of the factors at a point, given its number."""
        factors = self._study.factors
        if self._study.design == LIST:
            return tuple(factor.values[index] for factor in factors)
        if self._study.design == GRID:
            return _of_grid(factors, index)
        return tuple(
            at_quantile(factor, float(share))
            for factor, share in zip(factors, self._shares(index), strict=True)
        )


def _of_grid(factors: tuple[Factor, ...], index: int) -> tuple[Value, ...]:
    """Returns a point of a grid, in which the last factor changes fastest."""
    values: list[Value] = []
    for factor in reversed(factors):
        index, place = divmod(index, len(factor.values))
        values.append(factor.values[place])
    return tuple(reversed(values))


def _count(study: Study) -> int:
    if study.design in DRAWN:
        return study.points
    lengths = [len(factor.values) for factor in study.factors]
    return math.prod(lengths) if study.design == GRID else lengths[0]


def _shares(study: Study) -> Shares:
    """Returns a function from a point's number to the quantiles (factors,) of its values."""
    size = len(study.factors)
    if study.design == LATIN_HYPERCUBE and size:
        cube = qmc.LatinHypercube(size, seed=np.random.default_rng([study.seed, STREAM])).random(
            study.points
        )
        return lambda index: cube[index]
    if study.design == SOBOL and size:
        return _Sobol(size, study.seed)
    return lambda index: np.random.default_rng([study.seed, STREAM, index]).random(size)


class _Sobol:
    """Scrambled Sobol points; a smaller number than the last one restarts the sequence."""

    def __init__(self, size: int, seed: int) -> None:
        self._size, self._seed = size, seed
        self._restart()

    def _restart(self) -> None:
        self._engine = qmc.Sobol(
            self._size, scramble=True, seed=np.random.default_rng([self._seed, STREAM])
        )
        self._next = 0

    def __call__(self, index: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        if index < self._next:
            self._restart()
        if index > self._next:
            self._engine.fast_forward(index - self._next)
        self._next = index + 1
        point: np.ndarray[tuple[int], np.dtype[np.float64]] = self._engine.random(1)[0]
        return point


class Sweep:
    """The runs of a study without an optimiser, numbered by point, then seed, then control."""

    def __init__(self, study: Study) -> None:
        self._study, self._design = study, Design(study)
        self._place = next(
            (k for k, factor in enumerate(study.factors) if factor.name == SCENARIO_FACTOR), None
        )
        self._case = next(iter(study.cases))
        self.points = self._design.count
        self.count = self.points * len(study.seeds) * len(study.controls)

    def orders(self, runs: Iterator[int]) -> Iterator[Order]:
        """Yields the orders of runs, whose numbers should ascend."""
        known = -1
        values: tuple[Value, ...] = ()
        seeds, controls = self._study.seeds, self._study.controls
        for run in runs:
            pair, control = divmod(run, len(controls))
            point, seed = divmod(pair, len(seeds))
            if point != known:
                known, values = point, self._design.point(point)
            case = self._case if self._place is None else str(values[self._place])
            yield Order(
                run=run,
                point=point,
                case=case,
                values=values,
                seed=seeds[seed],
                control=controls[control],
            )


def check_design(study: Study) -> None:
    """Raises StudyError for factors that the design cannot take."""
    where = f"{study.where}: factors"
    drawn = [factor.name for factor in study.factors if factor.kind != VALUES]
    if study.design not in DRAWN and drawn:
        fix = (
            f'write design = "{RANDOM}" (or another of {", ".join(DRAWN)}) and points = 100, '
            "or give values"
        )
        raise StudyError(
            f"a distribution in a design {study.design!r}",
            got=drawn[0],
            expected="values",
            fix=fix,
            where=where,
        )
    lengths = {factor.name: len(factor.values) for factor in study.factors}
    if study.design == LIST and len(set(lengths.values())) > 1:
        fix = f'make them as long as each other, or write design = "{GRID}" for all combinations'
        raise StudyError(
            "lists of different lengths",
            got=lengths,
            expected="one value of each factor per point",
            fix=fix,
            where=where,
        )
    if study.design == LATIN_HYPERCUBE and study.points * len(study.factors) > MAX_STRATA:
        fix = f'write design = "{SOBOL}", which holds none'
        got, expected = (
            f"{study.points} points, {len(study.factors)} factors",
            f"points times factors of at most {MAX_STRATA:,}",
        )
        raise StudyError(
            "too large a Latin hypercube",
            got=got,
            expected=expected,
            fix=fix,
            where=f"{study.where}: points",
        )
    if study.design != GRID and not study.factors:
        fix = "leave design out to run the seeds alone"
        raise StudyError(
            "nothing to vary",
            got=f"design {study.design!r} without factors",
            expected="factors",
            fix=fix,
            where=where,
        )
