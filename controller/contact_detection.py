"""What the foot force sensors say, and whether they can be believed.

A foot touches down when its force rises above one threshold and lifts off when it falls below a
lower one, so that noise on a force near either makes no foot flicker. A sensor is not believed any
more when it contradicts for too long what must be: a force on a foot in the middle of its swing, or
none on a foot that is planned to carry its load while the others do not carry the whole weight in
its place. It is believed again when it has not contradicted anything for one and a half gait
cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hexapod_cosim.controller.kinematics import LEGS, Array, Mask

TOUCH, LIFT = (
    0.02,
    0.005,
)  # 1    of the weight: a foot with more has touched down, with less has lifted off
AIRBORNE_TIME = 0.06  # s    a force this long on a foot in mid-swing, ...
# s    or none this long on one that should carry, is a contradiction; both longer than the sensors'
# lag
ABSENT_TIME = 0.10
MISSING = (
    0.92  # 1    of the weight: less than this from all feet, and some force is not being reported
)
MEMORY = 1.5  # 1    gait cycles without contradiction until a sensor is believed again


class ContactDetector:
    """Touch-down and lift-off with hysteresis. `touching`: (6,)."""

    def __init__(self, weight: float) -> None:
        self._touch, self._lift = TOUCH * weight, LIFT * weight  # N
        self.reset()

    def reset(self) -> None:
        """All feet in the air."""
        self.touching = np.zeros(LEGS, dtype=np.bool_)

    def save(self) -> Mask:
        """Returns the state that restore() takes."""
        return self.touching

    def restore(self, state: Mask) -> None:
        """Restores a state returned by save()."""
        self.touching = state

    def step(self, normal: Array) -> Mask:
        """normal: (6,) [N]. Returns `touching`, a new array at every step."""
        self.touching = normal > np.where(self.touching, self._lift, self._touch)
        return self.touching


class SensorWatch:
    """Which foot sensors contradict the plan for too long.

    `doubted`: of each leg; `busy`: there is something to look after.
    """

    def __init__(self, weight: float, *, cycle: float) -> None:
        """weight [N] of the robot without payload, cycle [s] of the gait."""
        self._weight, self._memory = MISSING * weight, MEMORY * cycle
        self.reset()

    def reset(self) -> None:
        """All believed."""
        self.restore(([0.0] * LEGS, [0.0] * LEGS))

    def save(self) -> tuple[Any, ...]:
        """What it remembers: times of contradiction, and until each is believed again [s]."""
        return self._contradicted, self._left

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restores a state returned by save()."""
        self._contradicted, self._left = state
        self.doubted, self.busy = (
            [left > 0.0 for left in self._left],
            any(self._left) or any(self._contradicted),
        )

    def look(
        self,
        touching: Sequence[bool],
        total: float,
        standing: Sequence[bool],
        high: Sequence[bool],
        *,
        time: float,
    ) -> list[bool]:
        """After another `time` [s]. Returns `doubted`.

        Args:
            touching, total: which feet report a force, and the sum of all [N].
            standing, high: which legs are planned to carry their whole share, and which to be well
            above the ground.
        """
        missing = total < self._weight
        wrong = [
            (touches and up) or (missing and stands and not touches)
            for touches, stands, up in zip(touching, standing, high, strict=True)
        ]
        contradicted = [
            past + time if now else 0.0 for past, now in zip(self._contradicted, wrong, strict=True)
        ]
        limits = [AIRBORNE_TIME if up else ABSENT_TIME for up in high]
        left = [
            self._memory if past > limit else max(rest - time, 0.0)
            for past, limit, rest in zip(contradicted, limits, self._left, strict=True)
        ]
        self.restore((contradicted, left))
        return self.doubted
