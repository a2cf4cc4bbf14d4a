"""Differences of simulations: the derivatives of predictions by the unknown numbers.

Predictions jump where a touch-down or a lift-off does: a foot that barely leaves the ground has
another impact speed, and so another damping, than one that stays. Over such a jump a difference is
no derivative; its second difference shows it, and the reading does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
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
