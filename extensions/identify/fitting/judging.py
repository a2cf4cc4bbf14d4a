"""Judges what the readings say of the numbers that a search has found.

The covariance is that of the linearised problem with the spectra of the residuals (covariance.py),
plus the square of the step that the search left. Residuals larger than the noise of the readings
themselves say that the model does not explain the log, and widen all intervals. Numbers of the
robot file that the readings do not determine (misfit.py) keep its values, and the search ends with
them there. How far this moves the others is a part of their intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.fitting.covariance import coloured_information
from hexapod_cosim.extensions.identify.fitting.least_squares import BOUND, FINE, remaining_step
from hexapod_cosim.extensions.identify.fitting.misfit import (
    Misfit,
    determined,
    misfits,
    read_noise,
    sharpened,
    to_keep,
)
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.fitting.search import finished, searched
from hexapod_cosim.extensions.identify.numbers import Unknown
from hexapod_cosim.extensions.identify.unknowns import OF_FILE
from hexapod_cosim.models.arrays import Array

Flags = NDArray[np.bool_]
Progress = Callable[[str], None]
# of deriving weak combinations anew: the first errors of derivatives hide some in others
PASSES = 4


@dataclass(frozen=True)
class Fit:
    """Holds the most probable numbers, with what their intervals are made of."""

    rows: tuple[Unknown, ...]
    before: Mapping[str, float]  # values of the robot file
    z: Array  # (rows,)  distances from these, in priors
    covariance: Array  # (rows, rows) of z
    rank: int  # independent combinations that are known better than before
    noise: Mapping[str, float]  # by channel
    predictions: tuple[Array, ...]  # (rows, columns) of each experiment
    misfit: Mapping[str, Misfit]  # by channel
    held_out: Mapping[str, Misfit]  # the same on held-out rows; empty without them
    decrement: float  # length of the step that the optimiser left, in deviations
    kept: Flags  # (rows,)  numbers of the robot file that keep its values
    alone: Flags  # (rows,)  numbers that the readings determine by themselves

    @property
    def unexplained(self) -> dict[str, float]:
        """Returns the channels that the model does not explain, with the larger mean square."""
        found: dict[str, float] = {}
        for key, one in [*self.misfit.items(), *self.held_out.items()]:
            if not one.explained:
                found[key] = max(one.value, found.get(key, 0.0))
        return found

    @property
    def values(self) -> dict[str, float]:
        """Returns the numbers by key."""
        return {
            row.key: row.value(z, self.before[row.key])
            for row, z in zip(self.rows, self.z.tolist(), strict=True)
        }

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by key, in priors: 1 where the logs say nothing."""
        own = np.sqrt(np.diag(self.covariance))
        return {row.key: float(value) for row, value in zip(self.rows, own, strict=True)}


def fit(problem: Problem, *, progress: Progress = lambda _text: None) -> Fit:
    """Returns the most probable numbers of logs, with what the readings say of them.

    progress: called when a step begins.

    Raises HexapodError when the plant refuses the robot file's numbers.
    """
    fitted, best = searched(problem, progress)
    progress("what the log determines")
    least = read_noise(fitted.experiments)
    own = _evidence(fitted, best, least)
    kept = to_keep(own.information, np.array([row.group in OF_FILE for row in problem.rows]))
    z = np.where(kept, 0.0, best)
    with fitted.keeping(kept):
        if not np.array_equal(z, best):
            z = finished(fitted, z, lambda _text: None)
            own = _evidence(fitted, z, least)
        # where touch-downs make the sum of squares rough, the optimiser stops on the way
        left = remaining_step(own.jacobian, own.residuals, z, fitted.bounds())
    moved = z - best
    return Fit(
        rows=problem.rows,
        before=problem.before,
        z=z,
        covariance=own.covariance + np.outer(left, left) + np.outer(moved, moved),
        rank=int(np.sum(np.linalg.eigvalsh(own.information) > 1.0)),
        noise=dict(fitted.noise),
        predictions=tuple(problem.predictions(z)),
        misfit=own.misfit,
        held_out=misfits(problem.experiments, problem.predictions(z), least, "held_out"),
        decrement=float(np.sqrt(left @ np.linalg.solve(own.covariance, left))),
        kept=kept,
        alone=determined(own.information),
    )


@dataclass(frozen=True)
class _Evidence:
    """What readings say at some numbers."""

    jacobian: Array
    residuals: Array
    misfit: Mapping[str, Misfit]
    information: Array  # (rows, rows)  [1/prior^2]

    @property
    def covariance(self) -> Array:
        """Returns the covariance of the numbers with what was known before (rows, rows)."""
        return np.asarray(np.linalg.inv(self.information + np.eye(len(self.information))))


def _evidence(fitted: Problem, z: Array, least: Mapping[str, float]) -> _Evidence:
    """Returns what the readings say at some numbers. least: noise of the readings, by channel."""
    fitted.set_noise(fitted.errors(z))
    fitted.leave_out_bent(z, FINE)
    jacobian, residuals = fitted.jacobian(z, FINE), fitted.residuals(z)
    misfit = misfits(fitted.experiments, fitted.predictions(z), least, "fitted")
    # errors of the model count as noise
    worst = max(1.0, *(one.value for one in misfit.values()))
    bounded, far = np.clip(residuals, -BOUND, BOUND), jacobian
    information = coloured_information(fitted.series(far, bounded)) / worst
    for _ in range(PASSES):
        far = sharpened(fitted, z, far, information)
        information = coloured_information(fitted.series(far, bounded)) / worst
    return _Evidence(jacobian, residuals, misfit, information)
