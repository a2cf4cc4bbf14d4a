"""Differences of simulations: the derivatives of predictions by the unknown numbers.

Predictions jump where a touch-down or a lift-off does: a foot that barely leaves the ground and
touches it again has another impact speed, and so another damping, than one that stays. Over such a
jump a difference is no derivative; its second difference shows it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Change = tuple[float, Array]  # of a number [priors], and of the predictions (predictions,)


@dataclass(frozen=True)
class Slopes:
    """How derivatives are made of simulations."""

    step: float  # priors
    both: bool  # whether from both sides
    near: float  # priors: up to this distance from where they were made they count


# A long step is what the search needs while sums of squares are rough. But its error of second
# order hides combinations of numbers that the readings hardly tell: with it, the deviation of the
# torso's mass came out five times too small. Short central differences have converged there.
UNLIKE = 0.5  # difference of slopes to both sides, in the smaller one, beyond which one jumps
ROUGH = Slopes(0.1, both=False, near=0.1)
FINE = Slopes(0.01, both=True, near=1e-6)


@dataclass(frozen=True)
class Differences:
    """Differences of predictions at some numbers."""

    z: Array  # (numbers,)
    made: Slopes
    # of all predictions by each number: two of a long step of a delay, none where the plant
    # refuses the numbers
    slopes: list[list[Array]]
    bend: Array  # (predictions,)  largest second difference by a number that is no delay

    def hold(self, z: Array, slopes: Slopes) -> bool:
        """Returns whether they are such that count at z."""
        return self.made == slopes and float(np.max(np.abs(z - self.z))) <= slopes.near


def differences(
    z: Array,
    made: Slopes,
    changes: Sequence[Sequence[Change]],
    delays: Sequence[bool],
    count: int,
) -> Differences:
    """Returns slopes and second differences.

    Args:
        z: the numbers.
        made: how they were moved.
        changes: by each number.
        delays: whether a number is a delay, by which readings jump when a command comes.
        count: of the predictions.
    """
    bend = np.zeros(count)
    for own, delay in zip(changes, delays, strict=True):
        if len(own) == 2 and not delay:
            (_, forth), (_, back) = own
            second = np.abs(forth + back)
            np.maximum(bend, np.where(np.isfinite(second), second, 0.0), out=bend)
    slopes = [
        _slopes(own, long_delay=delay and made != FINE)
        for own, delay in zip(changes, delays, strict=True)
    ]
    return Differences(z, made, slopes, bend)


def _slopes(changes: Sequence[Change], *, long_delay: bool) -> list[Array]:
    """Returns the slopes that changes of predictions over steps give.

    long_delay: one for each of two long steps of a delay, else one for all.
    """
    found = [change / step for step, change in changes]
    if len(found) == 2 and not long_delay:
        found = [_central(*found)]
    return [np.where(np.isfinite(slope), slope, 0.0) for slope in found]


def _central(forth: Array, back: Array) -> Array:
    """Returns the means of slopes to both sides; where they differ, the smaller one.

    Over a jump a slope is too large, by so much more the shorter the step is.
    """
    smaller = np.where(np.abs(forth) < np.abs(back), forth, back)
    differ = np.abs(forth - back) > UNLIKE * np.abs(smaller)
    return np.where(differ, smaller, 0.5 * (forth + back))


def size_of(slope: Array) -> float:
    """Returns the square of a slope's length."""
    return float(slope @ slope)
