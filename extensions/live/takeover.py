"""How a controller hands over to the next one at a stand."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.controller import JointCommand

STILL = 0.02  # rad    joint commands that vary by less for half a gait period stand still


class Stop:
    """Tells when joint commands have stood still for `window` macro-steps, or after `most`."""

    def __init__(self, window: int, most: int) -> None:
        self._angles: deque[NDArray[np.float64]] = deque(maxlen=window)
        self._left = most

    def reached(self, angle: NDArray[np.float64]) -> bool:
        """Notes the joint angles (6, 3) [rad] of a macro-step."""
        self._angles.append(angle.copy())
        self._left -= 1
        if len(self._angles) < (self._angles.maxlen or 0):
            return False
        return self._left <= 0 or bool(np.ptp(np.array(self._angles), axis=0).max() < STILL)


def blend(old: JointCommand, new: JointCommand, share: float, duration: float) -> JointCommand:
    """Returns commands between two; the share runs from 0 to 1 in `duration` [s] as a cubic."""
    part = share * share * (3.0 - 2.0 * share)
    rate = 6.0 * share * (1.0 - share) / duration
    gap = new.angle_ref - old.angle_ref
    return JointCommand(
        angle_ref=old.angle_ref + part * gap,
        speed_ref=part * new.speed_ref + rate * gap,
        torque_ref=(1.0 - part) * old.torque_ref + part * new.torque_ref,
        acceleration_ref=part * new.acceleration_ref,
    )
