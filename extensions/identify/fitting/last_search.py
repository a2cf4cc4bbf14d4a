"""The last search of a fit: Gauss and Newton's steps until the next one is short.

Where a touch-down or a lift-off comes and goes with the numbers, predictions jump, and with them
the sum of squares. A search that counts these readings ends at the jump, which may be far from the
optimum, and derivatives there are none. So readings that jump within the steps of the derivatives,
or within a step of the search that fails, do not count from then on, whatever their residuals are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.fitting.differences import FINE
from hexapod_cosim.extensions.identify.fitting.problem import Problem

Array = NDArray[np.float64]
Progress = Callable[[str], None]
BOUND = 3.0  # deviations    of residuals; larger ones count linearly (Huber's loss)
# The last search ends where Gauss and Newton's next step is this long [deviations]. A relative
# change of the sum of squares is no measure: of a log of 60 s it is some 100,000, and a number that
# is wrong by a deviation adds 1.
ENOUGH = 0.1
FINISHING = 12  # steps of the last search, at most
# Readings that jump come and go near the optimum, so that a step is left, if a short one.
NEAR, SHORTER = 1.0, 0.5  # deviations; of the step before
# At the first steps all readings count anew. From then on those left out stay so: a search
# would go back and forth between two points at which different readings count.
ANEW = 2
SHORTENED = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step, until the sum of squares falls
SUFFICIENT = 0.1  # share of the fall that derivatives say
# A longer step changes residuals otherwise than derivatives say where nothing jumps, too.
LINEAR = 10.0  # deviations


def remaining_step(jacobian: Array, residuals: Array) -> Array:
    """Returns the step (rows,) that Gauss and Newton's method would still take, in priors.

    It is 0 at an optimum. Residuals beyond three deviations count linearly (Huber's loss).
    """
    bounded = np.clip(residuals, -BOUND, BOUND)
    share = np.sqrt(BOUND / np.maximum(np.abs(residuals), BOUND))
    weighted = jacobian * share[:, None]
    normal, right = weighted.T @ weighted, jacobian.T @ bounded
    return np.asarray(-np.linalg.lstsq(normal, right, rcond=None)[0], dtype=np.float64)


def bounded_step(problem: Problem, z: Array, jacobian: Array, residuals: Array) -> Array:
    """Returns the remaining step (rows,) of the numbers that it does not lead out of their limits.

    The others stay.
    """
    low, high = problem.bounds()
    free = np.ones(len(z), dtype=np.bool_)
    step = np.zeros(len(z))
    for _ in z:
        step = np.zeros(len(z))
        step[free] = remaining_step(jacobian[:, free], residuals)
        out = free & (((z <= low) & (step < 0.0)) | ((z >= high) & (step > 0.0)))
        if not out.any():
            break
        free &= ~out
    return step


def huber(residuals: Array) -> float:
    """Returns half the sum of squares; residuals beyond three deviations count linearly."""
    size = np.abs(residuals)
    near = np.minimum(size, BOUND)
    return float(np.sum(near * (size - 0.5 * near)))


def finished(problem: Problem, z: Array, report: Progress) -> Array:
    """Returns the numbers near a start at which the remaining step is short.

    The noise of a channel is the typical size of its residuals at each step.
    """
    before = np.inf
    for number in range(FINISHING):
        report(f"all rows again, step {number + 1} of at most {FINISHING}")
        if number < ANEW:
            problem.count_all()
        problem.set_noise(problem.errors(z))
        problem.leave_out_bent(z)
        better, length = _stepped(problem, z)
        if better is None or (length < NEAR and length > SHORTER * before):
            break
        z, before = better, length
    return z


def _stepped(problem: Problem, z: Array) -> tuple[Array | None, float]:
    """Returns the numbers after a step, and its length in deviations.

    None where it is short or no part of it is better.
    """
    low, high = problem.bounds()
    while True:
        jacobian, residuals = problem.jacobian(z, FINE), problem.residuals(z)
        step = bounded_step(problem, z, jacobian, residuals)
        length = float(np.linalg.norm(jacobian @ step))
        if length < ENOUGH:
            return None, length
        cost = huber(residuals)
        for share in SHORTENED:
            moved = np.clip(z + share * step, low, high)
            change = problem.residuals(moved) - residuals
            if huber(residuals + change) < cost - SUFFICIENT * share * length**2:
                return moved, length
            if share == 1.0 and length < LINEAR and np.isfinite(change).all():
                linear = jacobian @ (moved - z)
                if problem.leave_out_nonlinear(change, linear):
                    break  # again without these
        else:
            return None, length
