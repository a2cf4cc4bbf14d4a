"""Ground that is met too early or too late.

A foot that meets the ground before its path ends is not pressed into it: it keeps the height at
which it touched, through its stance. One that finds no ground where its path ends reaches down for
it, at a fixed speed and not without limit. What either added to the path goes again in the next
swing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from hexapod_cosim.controller.kinematics import LEGS

REACH_SPEED = 0.08  # m/s    downwards
REACH_LIMIT = 0.020  # m
HOLD_LIMIT = 0.030  # m    upwards: as high as a swing of the robots goes
GRACE = (
    0.040  # s    after the planned touch-down, in which a foot may be late without anyone minding
)
RETURN_TIME = 0.060  # s    in which an offset goes in the swing
EARLY = 0.002  # m    a foot that meets the ground with more of its way down to go has met it early
NEGLIGIBLE = 1e-5  # m    an offset less than this is none


class Touchdown:
    """Offsets of all feet. `offset`: of each leg [m], up; `busy`: there is something to look
    after.
    """

    def __init__(self, *, period: float) -> None:
        self._period, self._fade = period, math.exp(-period / RETURN_TIME)
        self.offset: list[float]
        self.reset()

    def reset(self) -> None:
        """No offsets."""
        self.restore(([0.0] * LEGS, [0.0] * LEGS))

    def save(self) -> tuple[Any, ...]:
        """Returns the state that restore() takes."""
        return self.offset, self._late

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restores a state returned by save()."""
        self.offset, self._late = state
        self.busy = any(self.offset) or any(self._late)

    def step(
        self,
        touching: Sequence[bool],
        falling: Sequence[float],
        swinging: Sequence[bool],
        loaded: Sequence[bool],
    ) -> list[float]:
        """One period.

        Args:
            touching: feet that report a force; falling: how far each path, well above its end,
                comes down in this period [m];
            swinging, loaded: planned in the air, planned to carry their whole share.
        """
        misses = [loads and not touches for loads, touches in zip(loaded, touching, strict=True)]
        late = [
            waited + self._period if missing else 0.0
            for waited, missing in zip(self._late, misses, strict=True)
        ]
        legs = zip(self.offset, late, touching, falling, swinging, strict=True)
        self.restore(([self._move(*leg) for leg in legs], late))
        return self.offset

    def _move(self, offset: float, late: float, touches: bool, fall: float, swings: bool) -> float:
        """One foot's next offset."""
        if late > GRACE:
            return max(offset - REACH_SPEED * self._period, -REACH_LIMIT)
        if swings and touches and fall > 0.0:
            return min(offset + fall, HOLD_LIMIT)
        if swings and not touches:
            return offset * self._fade if abs(offset) > NEGLIGIBLE else 0.0
        return offset
