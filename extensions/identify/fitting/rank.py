"""Decides which combinations of numbers readings tell, and which numbers they do not.

The information of the readings is a matrix in units of what was known before (1/prior^2). Its
eigenvectors are combinations of numbers. A derivative by differences of simulations has errors of
the integrator, which look like information where there is none: of the currents' constant k_t and
the resistance R a log without currents tells k_t^2/R alone, and errors of 0.001 deviations in each
of 10,000 readings told both within a tenth. So each combination of which readings seem to tell
little is moved as a whole over a long step, whose derivatives have smaller errors.

A number with a large share in a combination of which the readings tell less than what was known
before is not told, however small its deviation is: what was known of the others makes it so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.extensions.identify.fitting.differences import UNLIKE
from hexapod_cosim.extensions.identify.fitting.problem import Problem
from hexapod_cosim.extensions.identify.numbers.unknown import Unknown

Array = NDArray[np.float64]
QUANTILE = 1.959963985  # of a normal distribution, for 95 %
TOLD = 0.5  # of the prior deviation: a number with less is told by the logs
NEARLY_NULL = 1.0  # information [1/prior^2] of a combination: less than what was known before
# deviation of a number by nearly null combinations alone, from which on it is not told
BY_NULL = 1.0 / 3.0  # priors
MOST = 100.0  # information [1/prior^2] of a combination that `measured_information` corrects
LEAST = 0.05  # information [1/prior^2] of a combination that is not told whatever its errors are
LONGEST = 0.5  # priors    of such a move
PART = 0.05  # slope of a number by another one, from which on it takes part in a combination
SIMPLE = 4  # exponents in names are fractions with numerators and denominators up to this
CLOSE = 0.03  # of an exponent and a simple fraction


@dataclass(frozen=True)
class Combination:
    """Numbers of which readings tell a combination, but none by itself."""

    key: str  # the number that carries the combination, the others staying at the file's values
    others: tuple[str, ...]
    slopes: tuple[float, ...]  # of z of `key` by z of the others along what readings do not tell
    deviation: float  # of z of `key` while the others stay


@dataclass(frozen=True)
class Move:
    """A weak combination that simulations have moved as a whole, forth and back."""

    vector: Array  # (rows,) the combination, of length 1
    information: float  # [1/prior^2] that derivatives say
    way: Array  # (rows,) z forth less z back
    change: Array  # (readings,) of the residuals, forth less back


def weak_moves(problem: Problem, z: Array, information: Array, most: float) -> list[Move]:
    """Returns the weak combinations, each moved over its deviation, at most LONGEST.

    Args:
        problem: its readings that count.
        z: the numbers (rows,).
        information: what derivatives of the residuals tell (rows, rows).
        most: information of a weak combination, at most [1/prior^2].

    A combination whose simulation fails is left out.
    """
    found = []
    low, high = problem.bounds()
    values, vectors = np.linalg.eigh(information)
    for value, vector in zip(values.tolist(), vectors.T, strict=True):
        if not LEAST < value < most:
            continue
        step = min(LONGEST, value**-0.5) * vector
        forth, back = (np.clip(z + sign * step, low, high) for sign in (1.0, -1.0))
        change = (problem.residuals(forth) - problem.residuals(back))[: -len(z)]
        if np.isfinite(change).all():
            found.append(Move(vector, value, forth - back, change))
    return found


def sharpened(jacobian: Array, moves: Sequence[Move]) -> Array:
    """Returns the derivatives with those by weak combinations from simulations over long steps.

    Over a long step readings may jump: where both derivatives differ, the smaller one counts.

    jacobian: derivatives of the residuals, with the priors behind them.
    """
    found = jacobian.copy()
    count = len(jacobian) - jacobian.shape[1]
    for move in moves:
        length = float(move.way @ move.vector)
        if length <= 0.0:
            continue
        change, linear = move.change, jacobian[:count] @ move.way
        smaller = np.where(np.abs(change) < np.abs(linear), change, linear)
        differ = np.abs(change - linear) > UNLIKE * np.abs(smaller)
        shown = np.where(differ, smaller, change)
        if shown @ shown < linear @ linear:  # more is what bends or jumps over the long step
            found[:count] += np.outer((shown - linear) / length, move.vector)
    return found


def measured_information(information: Array, jacobian: Array, moves: Sequence[Move]) -> Array:
    """Returns the information (rows, rows) with what simulations of combinations say.

    Args:
        information: what the derivatives tell.
        jacobian: derivatives of the residuals, with the priors behind them.
        moves: of the combinations of this information.
    """
    found = information.copy()
    slopes = jacobian[: -len(information)]
    for move in moves:
        if move.information >= MOST:
            continue
        expected = slopes @ move.way
        share = float(move.change @ move.change) / max(float(expected @ expected), 1e-300)
        less = (1.0 - min(share, 1.0)) * move.information
        found -= less * np.outer(move.vector, move.vector)
    return found


def null_deviations(information: Array) -> Array:
    """Returns the deviation of each number by nearly null combinations alone (rows,) [priors]."""
    values, vectors = np.linalg.eigh(information)
    null = vectors[:, values < NEARLY_NULL]
    return np.asarray(np.sqrt(np.sum(null**2, axis=1)))


def told(information: Array) -> NDArray[np.bool_]:
    """Returns which numbers readings of an information (rows, rows) tell (rows,)."""
    covariance = np.linalg.inv(information + np.eye(len(information)))
    small = np.sqrt(np.diag(covariance)) < TOLD
    return np.asarray(small & (null_deviations(information) < BY_NULL))


def untold(information: Array, candidates: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Returns the numbers that are to stay as they were, so that readings tell all others (rows,).

    Of the candidates that are not told the one with the largest deviation stays; the others are
    judged again with it known, and so on.
    """
    stay = np.zeros(len(information), dtype=np.bool_)
    while True:
        free = np.flatnonzero(~stay)
        own = information[np.ix_(free, free)]
        open_ones = candidates[free] & ~told(own)
        if not open_ones.any():
            return stay
        deviations = np.diag(np.linalg.inv(own + np.eye(len(own))))
        stay[free[int(np.argmax(np.where(open_ones, deviations, -1.0)))]] = True


def combinations(
    information: Array,
    stay: NDArray[np.bool_],
    candidates: NDArray[np.bool_],
    rows: Sequence[Unknown],
) -> tuple[Combination, ...]:
    """Returns the combinations that readings tell of numbers which they do not tell one by one.

    stay: numbers that stay at the file's values. candidates: numbers that may carry one.
    """
    free, held = np.flatnonzero(~stay), np.flatnonzero(stay)
    if not len(held):
        return ()
    covariance = np.linalg.inv(information[np.ix_(free, free)] + np.eye(len(free)))
    slopes = -covariance @ information[np.ix_(free, held)]
    alone = told(information)
    found = []
    for place, k in enumerate(free.tolist()):
        if alone[k] or not candidates[k]:
            continue
        parts = np.flatnonzero(np.abs(slopes[place]) > PART)
        found.append(
            Combination(
                rows[k].key,
                tuple(rows[held[part]].key for part in parts.tolist()),
                tuple(slopes[place, parts].tolist()),
                float(np.sqrt(covariance[place, place])),
            )
        )
    return tuple(found)


def combination_text(one: Combination, rows: Sequence[Unknown], values: Mapping[str, float]) -> str:
    """Returns a combination as a formula of its numbers, with its value and 95 % interval.

    Numbers above 0 have exponents, so that readings tell their product. Otherwise they have
    factors, those at the numbers that were found.
    """
    known = {row.key: row for row in rows}
    own, others = known[one.key], [known[key] for key in one.others]
    half = QUANTILE * one.deviation * own.prior
    if own.positive and all(row.positive for row in others):
        powers = [
            -slope * own.prior / row.prior for row, slope in zip(others, one.slopes, strict=True)
        ]
        whole = _common(powers)
        factors = [(own.key, float(whole))]
        factors += [
            (row.key, _near(whole * power)) for row, power in zip(others, powers, strict=True)
        ]
        value = math.prod(values[key] ** power for key, power in factors)
        low, high = (value * math.exp(sign * whole * half) for sign in (-1.0, 1.0))
        return f"{_product(factors)} = {value:.5g} ({low:.5g} to {high:.5g})"
    terms = [
        (row.key, -slope * _unit(own, values) / _unit(row, values))
        for row, slope in zip(others, one.slopes, strict=True)
    ]
    half *= values[own.key] if own.positive else 1.0
    value = values[own.key] + sum(factor * values[key] for key, factor in terms)
    name = own.key + "".join(f" {factor:+.3g} {key}" for key, factor in terms)
    return f"{name} = {value:.5g} ({value - half:.5g} to {value + half:.5g})"


def _unit(row: Unknown, values: Mapping[str, float]) -> float:
    """Returns what a prior is worth at the numbers that were found, in the unit of the number."""
    return row.prior * (values[row.key] if row.positive else 1.0)


def _common(powers: Sequence[float]) -> int:
    """Returns the number up to SIMPLE by which all powers are nearly whole numbers; 1 without."""
    for whole in range(1, SIMPLE + 1):
        if all(abs(whole * one - round(whole * one)) < CLOSE * whole for one in powers):
            return whole
    return 1


def _near(power: float) -> float:
    """Returns a power, as a whole number where it nearly is one."""
    whole = float(round(power))
    return whole if whole != 0.0 and abs(power - whole) < SIMPLE * CLOSE else power


def _product(factors: Sequence[tuple[str, float]]) -> str:
    """Returns powers of numbers as a formula."""
    above, below = (
        [
            key if abs(power) == 1.0 else f"{key}^{abs(power):.2g}"
            for key, power in factors
            if sign * power > 0.0
        ]
        for sign in (1.0, -1.0)
    )
    return " / ".join([" * ".join(above), *below])
