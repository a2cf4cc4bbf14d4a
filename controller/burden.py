"""How much of the robot's weight its servos can carry, and what to do about the rest.

Legs that squeeze each other hold the robot up like an arch: kinematic control asks 0.6 of the
torque of them that the planned shares do, which have no squeeze. A robot heavier than its servos
carry without the arch has to keep it. With `most` the torque that a servo may be asked for, `peak`
the largest that any joint is asked for to carry the model's weight, of late, `scale` the weight
that the support believes and `heft` the measured one, both over the model's,

    allowed  = min(1, most/(scale peak))
    strength = min(allowed, full (allowed - none)/(full - none))     of the support
    carried  = min(1, most/(heft peak))
    freedom  = (carried - stays)/(goes - stays)                      of the slip PID, in [0, 1]

All legs are asked for the same part of their shares, so none gives way before the others, and below
`full` for less than servos have: what the arch asks of them comes on top. The slip PID takes no
squeeze away that carries. A robot far too heavy walks under kinematic control.
"""

from __future__ import annotations

import math
from typing import Any

QUICK = 0.2  # 1    of the time in which the support follows the weight: the arch must not go first
SUPPORTED = 0.54, 0.84  # 1    none, full
FREED = 0.8, 0.95  # 1    stays, goes: part of the weight that servos carry without the arch
OVERBURDENED = 1.35, 1.5  # 1    of the torque allowed: below the support helps, above it does not
BELIEVABLE = 0.5, 4.0  # 1    measured over modelled weight: less or more is no weight


class Burden:
    """Attributes: heft: measured over modelled weight;  strength, freedom: see above;
    overburdened: far too heavy.
    """

    def __init__(self, *, most: float, cycle: float, period: float, weight_time: float) -> None:
        """most [N m] that a servo may be asked for, cycle [s] of the gait, weight_time [s] of
        the support.
        """
        self._most, self._fade = most, math.exp(-period / cycle)
        self._follow = 1.0 - math.exp(-period / (QUICK * weight_time))
        self.reset()

    def reset(self) -> None:
        """As heavy as the model."""
        self.restore((1.0, 0.0, 1.0, 1.0, False))

    def save(self) -> tuple[Any, ...]:
        """Returns the state that restore() takes."""
        return self.heft, self._peak, self.strength, self.freedom, self.overburdened

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restores a state returned by save()."""
        self.heft, self._peak, self.strength, self.freedom, self.overburdened = state

    def weigh(self, ratio: float) -> None:
        """The measured over the modelled weight at this period."""
        least, most = BELIEVABLE
        self.heft += self._follow * (min(max(ratio, least), most) - self.heft)

    def step(self, needed: float, scale: float) -> None:
        """One period on.

        needed: largest torque to carry the model's weight [N m];  scale: what the support believes.
        """
        self._peak = peak = max(needed, self._fade * self._peak)
        least, most = OVERBURDENED
        self.overburdened = self.heft * peak > self._most * (least if self.overburdened else most)
        allowed, (none, full) = self._most / max(scale * peak, self._most), SUPPORTED
        self.strength = min(allowed, max(full * (allowed - none) / (full - none), 0.0))
        borne, (none, full) = self._most / max(self.heft * peak, self._most), FREED
        self.freedom = min(max((borne - none) / (full - none), 0.0), 1.0)
