"""Bounded least squares with Huber's loss: the core of every fit of this extension.

A residual is a difference in deviations of its noise. Residuals beyond BOUND count linearly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.models.arrays import Array

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
    return damped_step(jacobian, residuals, z, bounds, 0.0)


def damped_step(
    jacobian: Array, residuals: Array, z: Array, bounds: tuple[Array, Array], damping: float
) -> Array:
    """Returns a step of Levenberg's method. damping: added to the normal matrix's diagonal."""
    bounded = np.clip(residuals, -BOUND, BOUND)
    share = np.sqrt(BOUND / np.maximum(np.abs(residuals), BOUND))
    weighted = jacobian * share[:, None]
    normal, right = weighted.T @ weighted + damping * np.eye(len(z)), jacobian.T @ bounded
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


# A search ends where Gauss and Newton's next step is this long [deviations]. A relative change of
# the sum of squares is no measure: of a log of 60 s it is some 100,000, and a number that is wrong
# by a deviation adds 1.
ENOUGH = 0.1
SHORTENED = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step, until the sum of squares falls
SUFFICIENT = 0.1  # share of the fall that derivatives say


def stepped(
    residuals: Callable[[Array], Array], jacobian: Array, z: Array, bounds: tuple[Array, Array]
) -> tuple[Array | None, float]:
    """Returns the numbers after a step of Gauss and Newton's method, and its length in deviations.

    jacobian: derivatives of the residuals at z. None where the step is short or no part of it is
    better.
    """
    before = residuals(z)
    step = remaining_step(jacobian, before, z, bounds)
    length = float(np.linalg.norm(jacobian @ step))
    if length >= ENOUGH:
        cost = huber(before)
        for share in SHORTENED:
            moved = np.clip(z + share * step, *bounds)
            if huber(residuals(moved)) < cost - SUFFICIENT * share * length**2:
                return moved, length
    return None, length


UNLIKE = 0.5  # difference of slopes to both sides, in the smaller one, beyond which one jumps


@dataclass(frozen=True)
class Slopes:
    """How derivatives are made of simulations."""

    step: float  # priors
    both: bool  # whether from both sides
    near: float  # priors: up to this distance from where they were made they count


# A long step is what the search needs while sums of squares are rough. But its error of second
# order hides combinations of numbers that the readings hardly show: with it, the deviation of the
# torso's mass came out five times too small. Short central differences have converged there.
ROUGH = Slopes(0.1, both=False, near=0.1)
FINE = Slopes(0.01, both=True, near=1e-6)


@dataclass(frozen=True)
class Differences:
    """Differences of predictions at some numbers."""

    z: Array  # (numbers,)
    made: Slopes
    slopes: Array  # (predictions, numbers)  0 where the plant refuses the numbers
    bend: Array  # (predictions,)  largest second difference by a number that is no delay

    def count_at(self, z: Array, made: Slopes) -> bool:
        """Returns whether they count at numbers z."""
        return self.made == made and float(np.max(np.abs(z - self.z))) <= made.near


def differences(changes: Sequence[tuple[float, Array]], count: int) -> tuple[Array, Array]:
    """Returns slopes and second differences (predictions,) of steps of a number and the changes
    that they make.

    Of two slopes it is the mean; where they differ, the smaller one: over a jump a slope is too
    large, by so much more the shorter the step is.
    """
    found = [change / step for step, change in changes]
    bend = np.zeros(count)
    if not found:
        return np.zeros(count), bend
    slope = found[0]
    if len(found) == 2:
        forth, back = found
        smaller = np.where(np.abs(forth) < np.abs(back), forth, back)
        differ = np.abs(forth - back) > UNLIKE * np.abs(smaller)
        slope = np.where(differ, smaller, 0.5 * (forth + back))
        bend = np.nan_to_num(np.abs(changes[0][1] + changes[1][1]), posinf=0.0)
    return np.where(np.isfinite(slope), slope, 0.0), bend
