"""Turns steps of the body command into smooth changes (C1). C: command.h."""

from __future__ import annotations

import itertools
import math
from dataclasses import astuple, dataclass
from numbers import Real

import numpy as np

from hexapod_cosim.controller.memory import Stateful
from hexapod_cosim.controller.plane import Array
from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.errors import check_type


@dataclass(frozen=True)
class BodyCommand:
    """Desired velocity of the torso, in its own frame, and posture."""

    vx: float = 0.0  # m/s    forward
    vy: float = 0.0  # m/s    to the left
    yaw_rate: float = 0.0  # rad/s    to the left
    height: float = 0.0  # m    above the stance
    roll: float = 0.0  # rad    z-y-x; positive lowers the right side
    pitch: float = 0.0  # rad    positive lowers the nose

    def __post_init__(self) -> None:
        """Raises HexapodError for a field that is not a finite number."""
        expected = "a finite number"
        for name, value in vars(self).items():
            check_type(value, Real, expected, where=name)
            if not math.isfinite(value):
                fix = "check where the command comes from"
                raise HexapodError(
                    "impossible body command", got=value, expected=expected, fix=fix, where=name
                )


class CommandRamp(Stateful):
    """Turns steps of the command into smooth changes (C1).

    A change is a cubic from the present value and rate to the new value and rate 0.

    Attributes:
        target: the command that the ramp leads to.
        steps: periods since that command was given; the controller counts them.
    """

    STATE = ("target", "steps", "_goal", "_cubic")

    def __init__(self, duration: float, *, period: float) -> None:
        self.duration, self.period = duration, period  # s
        least = itertools.count(int(duration / period))
        self.end = next(number for number in least if number * period >= duration)  # periods
        self.reset()

    def reset(self) -> None:
        """Sets the command to zero, at rest."""
        self.target, self._goal = BodyCommand(), np.zeros(6)
        self._cubic = np.zeros((4, 6))
        self.steps = self.end

    def settled(self) -> bool:
        """Returns whether the ramp has reached its target."""
        return self.steps >= self.end

    def moves(self) -> bool:
        """Returns whether the body is commanded to move, and not only to change its posture."""
        target = self.target
        return (target.vx, target.vy, target.yaw_rate) != (0.0, 0.0, 0.0)

    def _bend(self, value: Array, rate: Array) -> None:
        """Sets the cubic from a value and rate (6,) to the goal at rest (C1)."""
        gap, slope = self._goal - value, rate * self.duration
        self._cubic = np.array([value, slope, 3.0 * gap - 2.0 * slope, slope - 2.0 * gap])

    def aim(self, target: BodyCommand) -> bool:
        """Starts a ramp to a command. Returns whether the command is a new one."""
        if target == self.target:
            return False
        value, rate = self.ahead(0)
        self.target, self.steps = target, 0
        self._goal = np.array(astuple(target), dtype=np.float64)
        self._bend(value, rate)
        return True

    def carry(self, before: CommandRamp) -> None:
        """Continues the change of another ramp, from its present value and rate, in its own time.

        before: a ramp of the same period whose present step is that of this one.
        """
        target, (value, rate) = before.target, before.ahead(0)
        self.target, self._goal = target, before._goal
        self.steps = self.end if before.settled() else 0
        self._bend(value, rate)

    def ahead(self, steps: int) -> tuple[Array, Array]:
        """Returns the command `steps` periods ahead, and its rate per second.

        Each is (6,): vx vy yaw_rate height roll pitch.
        """
        number = self.steps + steps
        if number >= self.end:
            return self._goal, np.zeros(6)
        x = number * self.period / self.duration
        c0, c1, c2, c3 = self._cubic
        value = c0 + x * (c1 + x * (c2 + x * c3))
        rate = (c1 + x * (2.0 * c2 + 3.0 * x * c3)) / self.duration
        return value, rate
