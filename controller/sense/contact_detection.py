"""Detects contacts from foot forces. C: contact_detection.h.

A foot touches down when its force rises above one threshold and lifts off when it falls below a
lower one, so that noise near a threshold does not toggle the contact (C23).
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import LEGS, Array, Mask

CONTACT_SHARE = 0.02  # 1    of the weight: a foot with more has touched down
LIFT_SHARE = 0.005  # 1    of the weight: a foot with less has lifted off


class ContactDetector(Stateful):
    """Detects touch-down and lift-off with hysteresis. `contact`: (6,) feet on the ground."""

    STATE = ("contact",)

    def __init__(self, weight: float) -> None:
        """Starts with all feet in the air. weight: of the robot [N]."""
        self.weight = weight
        self.reset()

    def reset(self) -> None:
        """Sets all feet to be in the air."""
        self.contact: Mask = np.zeros(LEGS, dtype=np.bool_)

    def step(self, normal: Array) -> Mask:
        """Updates and returns `contact` for normal forces (6,) [N] (C23)."""
        limit = np.where(self.contact, LIFT_SHARE * self.weight, CONTACT_SHARE * self.weight)
        self.contact = normal > limit
        return self.contact
