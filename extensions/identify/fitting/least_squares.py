"""Bounded least squares with Huber's loss: the core of every fit of this extension.

A residual is a difference in deviations of its noise. Residuals beyond BOUND count linearly.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BOUND = 3.0  # deviations


def huber(residuals: Array) -> float:
    """Returns half the sum of squares; residuals beyond BOUND count linearly."""
    size = np.abs(residuals)
    near = np.minimum(size, BOUND)
    return float(np.sum(near * (size - 0.5 * near)))


def minimised(
    residuals: Callable[[Array], Array],
    start: Array,
    *,
    jacobian: Callable[[Array], Array],
    bounds: tuple[Array, Array],
    bound: float = BOUND,
    steps: int = 25,
    enough: float = 1e-4,
) -> Array:
    """Returns the numbers (numbers,) with the least sum of squares near a start.

    Args:
        residuals: of numbers, in deviations (residuals,).
        start: where the search begins.
        jacobian: derivatives of the residuals (residuals, numbers).
        bounds: least and largest numbers.
        bound: residuals beyond it count linearly [deviations].
        steps: evaluations at most.
        enough: relative change of the sum of squares at which the search ends.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415  slow to import

    found = least_squares(
        residuals,
        start,
        jac=jacobian,
        bounds=bounds,
        loss="huber",
        f_scale=bound,
        max_nfev=steps,
        ftol=enough,
        xtol=1e-6,
        gtol=1e-8,
    )
    return np.asarray(found.x, dtype=np.float64)


def remaining_step(
    jacobian: Array, residuals: Array, z: Array, bounds: tuple[Array, Array]
) -> Array:
    """Returns the step (numbers,) that Gauss and Newton's method would still take from numbers z.

    It is 0 at an optimum. Numbers at a bound that it would lead beyond stay there.
    """
    bounded = np.clip(residuals, -BOUND, BOUND)
    share = np.sqrt(BOUND / np.maximum(np.abs(residuals), BOUND))
    weighted = jacobian * share[:, None]
    normal, right = weighted.T @ weighted, jacobian.T @ bounded
    free = np.ones(len(z), dtype=np.bool_)
    step = np.zeros(len(z))
    for _ in z:
        step = np.zeros(len(z))
        own = np.ix_(free, free)
        step[free] = -np.linalg.lstsq(normal[own], right[free], rcond=None)[0]
        out = free & (((z <= bounds[0]) & (step < 0.0)) | ((z >= bounds[1]) & (step > 0.0)))
        if not out.any():
            break
        free &= ~out
    return step
