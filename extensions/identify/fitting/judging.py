"""Judges what the readings tell of the numbers that a search has found.

The covariance is that of the linearised problem with the spectra of the residuals (covariance.py),
plus the square of the step that the search left. Residuals larger than the noise of the readings
themselves say that the model does not explain the log: they widen all intervals, and far larger
ones reject the model. Numbers of the robot file that the readings do not tell (rank.py) keep its
values, and the search ends with them there. How far this moves the others is a part of their
intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.fitting.covariance import (
    Series,
    coloured_information,
    readings_as_one,
)
from hexapod_cosim.extensions.identify.fitting.differences import FINE
from hexapod_cosim.extensions.identify.fitting.last_search import BOUND, bounded_step, finished
from hexapod_cosim.extensions.identify.fitting.misfit import Misfit
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.fitting.rank import (
    Combination,
    combinations,
    measured_information,
    sharpened,
    told,
    untold,
    weak_moves,
)
from hexapod_cosim.extensions.identify.numbers.unknown import Unknown
from hexapod_cosim.extensions.identify.unknowns import OF_FILE

Array = NDArray[np.float64]
Progress = Callable[[str], None]
# Combinations with less information [1/prior^2] are simulated as a whole over their deviation: near
# a foot that barely lifts, slopes by short steps are steep and do not hold as far as the interval
# reaches. Where the first errors of derivatives hide combinations in others, the second time shows
# them.
WEAK, PASSES = 1000.0, 2
ROUNDS = 3  # of keeping numbers at the file's values, at most


@dataclass(frozen=True)
class Fit:
    """Holds the most probable numbers, with what their intervals are made of."""

    rows: tuple[Unknown, ...]
    before: Mapping[str, float]  # values of the robot file
    z: Array  # (rows,)  distances from these, in priors
    covariance: Array  # (rows, rows) of z
    singular: Array  # singular values of the readings' sensitivity, in priors, largest first
    noise: Mapping[str, float]  # by channel
    correlated: Mapping[str, float]  # by channel: readings that count as one
    predictions: tuple[Array, ...]  # (rows, columns) of each experiment
    misfit: Mapping[str, Misfit]  # by channel
    held_out: Mapping[str, Misfit]  # the same on held-out rows; empty without them
    decrement: float  # length of the step that the optimiser left, in deviations
    stay: NDArray[np.bool_]  # (rows,)  numbers of the robot file that keep its values
    alone: NDArray[np.bool_]  # (rows,)  numbers that the readings tell by themselves
    combinations: tuple[Combination, ...]  # of numbers that they tell together alone

    @property
    def unexplained(self) -> dict[str, float]:
        """Returns the channels that the model does not explain, with the larger mean square."""
        both = [*self.misfit.items(), *self.held_out.items()]
        found: dict[str, float] = {}
        for key, one in both:
            if not one.explained:
                found[key] = max(one.value, found.get(key, 0.0))
        return found

    @property
    def rejected(self) -> dict[str, float]:
        """Returns the channels by which the model is rejected, with the mean square."""
        return {key: one.value for key, one in self.misfit.items() if one.rejected}

    @property
    def values(self) -> dict[str, float]:
        """Returns the numbers by key."""
        return {
            row.key: row.value(z, self.before[row.key])
            for row, z in zip(self.rows, self.z.tolist(), strict=True)
        }

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by key, in priors: 1 where the logs tell nothing."""
        own = np.sqrt(np.diag(self.covariance))
        return {row.key: float(value) for row, value in zip(self.rows, own, strict=True)}


@dataclass(frozen=True)
class _Told:
    """What readings tell at some numbers."""

    jacobian: Array
    residuals: Array
    series: Sequence[Series]
    misfit: Mapping[str, Misfit]
    information: Array  # (rows, rows)  [1/prior^2]
    covariance: Array  # (rows, rows)  with what was known before


def judged(
    problem: Problem, fitted: Problem, z: Array, least: Mapping[str, float], report: Progress
) -> Fit:
    """Returns the numbers with what the readings tell of them.

    Args:
        problem: of the whole logs.
        fitted: of their fitted rows.
        z: the numbers.
        least: noise of the readings themselves, by channel.
        report: called when a step begins.
    """
    report("what the log tells")
    best, candidates = z, np.array([row.group in OF_FILE for row in problem.rows])
    stay = np.zeros(len(z), dtype=np.bool_)
    own = _told(fitted, z, least)
    for _ in range(ROUNDS):
        more = stay | untold(own.information, candidates)
        if any(one.rejected for one in own.misfit.values()) or np.array_equal(more, stay):
            break
        stay, z = more, np.where(more, 0.0, z)
        if float(np.max(np.abs(z - best))) > FINE.near:
            with fitted.holding(stay):
                z = finished(fitted, z, lambda _text: None)  # a part of this step
        own = _told(fitted, z, least)
    with fitted.holding(stay):
        # where touch-downs make the sum of squares rough, the optimiser stops on the way
        left = bounded_step(fitted, z, own.jacobian, own.residuals)
    moved, covariance = z - best, own.covariance
    eigenvalues = np.linalg.eigvalsh(own.information)[::-1]
    return Fit(
        rows=problem.rows,
        before=problem.before,
        z=z,
        covariance=np.asarray(covariance + np.outer(left, left) + np.outer(moved, moved)),
        singular=np.sqrt(np.maximum(eigenvalues, 0.0)),
        noise=dict(fitted.noise),
        correlated=readings_as_one(own.series, covariance),
        decrement=float(np.sqrt(left @ np.linalg.solve(covariance, left))),
        predictions=tuple(problem.predictions(z)),
        misfit=own.misfit,
        held_out=problem.misfit(z, least, "held_out"),
        stay=stay,
        alone=told(own.information),
        combinations=combinations(own.information, stay, candidates, problem.rows),
    )


def _told(fitted: Problem, z: Array, least: Mapping[str, float]) -> _Told:
    """Returns what the readings tell at some numbers."""
    fitted.set_noise(fitted.errors(z))
    fitted.leave_out_bent(z)
    jacobian, residuals = fitted.jacobian(z, FINE), fitted.residuals(z)
    bounded = np.clip(residuals, -BOUND, BOUND)
    misfit = fitted.misfit(z, least, "fitted")
    # errors of the model count as noise; at most the whole prior is unknown
    worst = max(1.0, *(one.value for one in misfit.values()))
    series = fitted.series(jacobian, bounded)
    information = coloured_information(series) / worst
    moves = weak_moves(fitted, z, information, WEAK)
    first = _covariance(measured_information(information, jacobian, moves))
    far = jacobian  # over deviations; the step that the search left is by its own derivatives
    for again in range(PASSES):
        moves = weak_moves(fitted, z, information, WEAK) if again else moves
        far = sharpened(far, moves)
        series = fitted.series(far, bounded)
        information = coloured_information(series) / worst
    # both are estimates, and intervals that are too narrow are worse than wide ones
    second = _covariance(information)
    wider = np.sqrt(np.maximum(np.diag(second) / np.diag(first), 1.0))
    covariance = first * np.outer(wider, wider)
    return _Told(jacobian, residuals, series, misfit, information, covariance)


def _covariance(information: Array) -> Array:
    """Returns the covariance of numbers with what was known before (rows, rows)."""
    own = np.linalg.inv(information + np.eye(len(information)))
    return np.asarray(own, dtype=np.float64)
