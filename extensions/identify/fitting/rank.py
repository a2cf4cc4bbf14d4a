"""Decides which numbers readings determine.

The information of the readings is a matrix in units of what was known before (1/prior^2). Its
eigenvectors are combinations of numbers. A derivative by differences of simulations has errors of
the integrator, which look like information where there is none: of the currents' constant k_t and
the resistance R a log without currents determines k_t^2/R alone, and errors of 0.001 deviations in
each of 10,000 readings determined both within a tenth. Near a foot that barely lifts, slopes are
steep in a range far shorter than an interval. So each combination of which the readings seem to say
little is simulated as a whole over its deviation, which gives its derivatives anew.

A number with a large share in a combination of which the readings say less than what was known
before is not determined, however small its deviation is: what was known of the others makes it so.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.fitting.differences import UNLIKE
from hexapod_cosim.extensions.identify.fitting.problem import Problem

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
DETERMINED = 0.5  # of the prior deviation: a number with less is determined by the logs
NEARLY_NULL = 1.0  # information [1/prior^2] of a combination: less than what was known before
# deviation of a number by nearly null combinations alone, from which on it is not determined
BY_NULL = 1.0 / 3.0  # priors
WEAK = 1000.0  # information [1/prior^2] of a combination that is simulated as a whole
LEAST = 0.05  # information [1/prior^2] of a combination that says nothing whatever its errors are
LONGEST = 0.5  # priors    of such a move
PART = 0.05  # slope of a number by another one, from which on it depends on it


def sharpened(problem: Problem, z: Array, jacobian: Array, information: Array) -> Array:
    """Returns the derivatives with those by weak combinations from simulations over long steps.

    Over a long step readings may jump: where both derivatives differ, the smaller one counts.

    Args:
        problem: its readings that count.
        z: the numbers (rows,).
        jacobian: derivatives of the residuals, with the priors behind them.
        information: what these say (rows, rows).

    A combination whose simulation fails stays as it is.
    """
    found = jacobian.copy()
    count = len(jacobian) - len(z)
    low, high = problem.bounds()
    values, vectors = np.linalg.eigh(information)
    for value, vector in zip(values.tolist(), vectors.T, strict=True):
        if not LEAST < value < WEAK:
            continue
        step = min(LONGEST, value**-0.5) * vector
        forth, back = (np.clip(z + sign * step, low, high) for sign in (1.0, -1.0))
        change = (problem.residuals(forth) - problem.residuals(back))[:count]
        linear, length = jacobian[:count] @ (forth - back), float((forth - back) @ vector)
        if length <= 0.0 or not np.isfinite(change).all():
            continue
        smaller = np.where(np.abs(change) < np.abs(linear), change, linear)
        differ = np.abs(change - linear) > UNLIKE * np.abs(smaller)
        shown = np.where(differ, smaller, change)
        if shown @ shown < linear @ linear:  # more is what bends or jumps over the long step
            found[:count] += np.outer((shown - linear) / length, vector)
    return found


def determined(information: Array) -> Flags:
    """Returns which numbers readings of an information (rows, rows) determine (rows,)."""
    covariance = np.linalg.inv(information + np.eye(len(information)))
    small = np.sqrt(np.diag(covariance)) < DETERMINED
    values, vectors = np.linalg.eigh(information)
    null = vectors[:, values < NEARLY_NULL]
    return np.asarray(small & (np.sqrt(np.sum(null**2, axis=1)) < BY_NULL))


def to_keep(information: Array, candidates: Flags) -> Flags:
    """Returns the numbers that are to stay as they were, so that readings determine all others.

    Of the candidates (rows,) that are not determined the one with the largest deviation stays; the
    others are judged again with it known, and so on.
    """
    kept = np.zeros(len(information), dtype=np.bool_)
    while True:
        free = np.flatnonzero(~kept)
        own = information[np.ix_(free, free)]
        open_ones = candidates[free] & ~determined(own)
        if not open_ones.any():
            return kept
        deviations = np.diag(np.linalg.inv(own + np.eye(len(own))))
        kept[free[int(np.argmax(np.where(open_ones, deviations, -1.0)))]] = True


def dependences(information: Array, kept: Flags, candidates: Flags) -> dict[int, list[int]]:
    """Returns the numbers that readings determine only together with kept ones, and these.

    kept: numbers that stay at the file's values. candidates: numbers that may depend on them.
    """
    free, others = np.flatnonzero(~kept), np.flatnonzero(kept)
    if not len(others):
        return {}
    covariance = np.linalg.inv(information[np.ix_(free, free)] + np.eye(len(free)))
    slopes = covariance @ information[np.ix_(free, others)]
    alone = determined(information)
    return {
        k: others[np.abs(own) > PART].tolist()
        for k, own in zip(free.tolist(), slopes, strict=True)
        if candidates[k] and not alone[k]
    }
