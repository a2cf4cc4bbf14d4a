"""Numbers the runs of a study and makes the order of each from its number.

There is no list of all points in memory. Latin hypercubes and Sobol sequences are the exception:
they are held as a whole, with 8 bytes per point and factor.
"""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from hexapod_cosim.extensions.study.factors import at_quantile
from hexapod_cosim.extensions.study.records import (
    DRAWN,
    GRID,
    LATIN_HYPERCUBE,
    SCENARIO_FACTOR,
    SOBOL,
    Evaluation,
    Factor,
    Order,
    Study,
    Value,
)

STREAM = 2  # of random numbers of the study's seed; scenarios use the streams 0 and 1
Shares = Callable[[int], np.ndarray[tuple[int], np.dtype[np.float64]]]


class Design:
    """The points of a study."""

    def __init__(self, study: Study) -> None:
        self._study = study
        lengths = [len(factor.values) for factor in study.factors]
        self._shape = lengths if study.design == GRID else lengths[:1]
        self.count = study.points if study.design in DRAWN else math.prod(self._shape)
        self._shares = _shares(study)

    def point(self, index: int) -> tuple[Value, ...]:
        """Returns the values of the factors at a point; in a grid the last one changes fastest."""
        factors = self._study.factors
        if self._study.design in DRAWN:
            pairs = zip(factors, self._shares(index).tolist(), strict=True)
            return tuple(at_quantile(factor, share) for factor, share in pairs)
        places: Sequence[Any] = (index,) * len(factors)
        if self._study.design == GRID and factors:
            places = np.unravel_index(index, self._shape)
        return tuple(factor.values[place] for factor, place in zip(factors, places, strict=True))


def _shares(study: Study) -> Shares:
    """Returns a function from a point's number to the quantiles (factors,) of its values."""
    from scipy.stats import qmc  # noqa: PLC0415  slow to import, and workers draw no points

    size, seed = len(study.factors), np.random.default_rng([study.seed, STREAM])
    if study.design == LATIN_HYPERCUBE and size:
        cube = qmc.LatinHypercube(size, seed=seed).random(study.points)
        return lambda index: cube[index]
    if study.design == SOBOL and size:
        with warnings.catch_warnings():  # of points that are no power of two: the report notes it
            warnings.simplefilter("ignore", UserWarning)
            sequence = qmc.Sobol(size, scramble=True, seed=seed).random(study.points)
        return lambda index: sequence[index]
    return lambda index: np.random.default_rng([study.seed, STREAM, index]).random(size)


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


class Optimisation:
    """Numbers the runs: those of all trials, of the unchanged settings, then the held-out ones."""

    def __init__(self, study: Study) -> None:
        assert study.optimise is not None
        self.study, self.asked = study, study.optimise
        self.unset = (None,) * len(study.factors)  # leaves variables as the scenarios have them

    def training(self, point: int, values: tuple[Value | None, ...]) -> list[Order]:
        """Returns the training runs of a trial, whose number is `point`."""
        part = self.asked.training
        return self._orders(part, point * part.runs, point, values)

    def held_out(self, place: int, point: int, values: tuple[Value | None, ...]) -> list[Order]:
        """Returns the held-out runs of the settings that are evaluated as number `place`."""
        part = self.asked.held_out
        return self._orders(part, self.asked.trained + place * part.runs, point, values)

    def _orders(
        self, part: Evaluation, first: int, point: int, values: tuple[Value | None, ...]
    ) -> list[Order]:
        common: dict[str, Any] = {
            "point": point,
            "values": values,
            "control": self.asked.control,
        }
        pairs = enumerate(product(part.cases, part.seeds), first)
        return [Order(run=run, case=case, seed=seed, **common) for run, (case, seed) in pairs]


def count_runs(study: Study) -> int:
    """Returns the number of runs of a study, for an optimisation the largest possible one."""
    return Sweep(study).count if study.optimise is None else study.optimise.most


def settings_of(order: Order, factors: Sequence[Factor]) -> list[tuple[Factor, Value]]:
    """Returns the factors that the order sets, with their values."""
    return [
        (factor, value)
        for factor, value in zip(factors, order.values, strict=True)
        if value is not None
    ]


def identity(order: Order, factors: Sequence[Factor]) -> str:
    """Returns the hash of a run's scenario, settings, seed and control."""
    named = {factor.name: value for factor, value in settings_of(order, factors)}
    content = [order.case, named, order.seed, order.control]
    key = json.dumps(content, sort_keys=True, default=str).encode()
    return hashlib.sha256(key).hexdigest()[:16]
