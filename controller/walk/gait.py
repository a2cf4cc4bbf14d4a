"""Defines gaits: the times at which each leg stands and swings. C: gait.h.

The phase of a leg is its offset plus the gait clock, modulo 1; below the duty factor it stands,
above it swings (C2). The offsets are OpenSHC's multiplier x offset / (stance + swing), given there
around the robot (front right, mid right, rear right, rear left, mid left, front left) and turned
here into the order LF LM LR RF RM RR.
"""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from types import NoneType

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.models import GAITS, HexapodError, Robot, unknown_name
from hexapod_cosim.models.errors import check_type

AROUND_TO_LEGS = (5, 4, 3, 0, 1, 2)  # LF LM LR RF RM RR in the order around the robot


@dataclass(frozen=True)
class Pattern:
    """The timing of a gait in whole numbers.

    A cycle has stance + swing parts; the offset of a leg around the robot is its multiplier times
    `offset` parts.
    """

    stance: int
    swing: int
    offset: int
    multipliers: tuple[int, int, int, int, int, int]

    @property
    def duty(self) -> float:
        """Returns the least duty factor at which the offsets leave no gap in the support."""
        return self.stance / (self.stance + self.swing)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Returns the phase offsets (6,) in [0, 1), legs in the order LF LM LR RF RM RR."""
        parts = self.stance + self.swing
        return tuple((self.multipliers[k] * self.offset % parts) / parts for k in AROUND_TO_LEGS)


PATTERNS = {
    "tripod": Pattern(2, 2, 2, (0, 1, 0, 1, 0, 1)),
    "ripple": Pattern(4, 2, 1, (2, 0, 4, 1, 3, 5)),
    "wave": Pattern(10, 2, 2, (2, 3, 4, 1, 0, 5)),
    "amble": Pattern(2, 1, 1, (1, 2, 0, 1, 2, 0)),
}


@dataclass(frozen=True, kw_only=True)
class Gait:
    """Timing and size of the steps. Raises HexapodError for impossible values."""

    name: str
    period: float  # s    one cycle of a leg
    duty: float  # 1    share of the cycle on the ground
    offsets: tuple[float, ...]  # 1    (6,) phase of each leg at clock 0
    step_height: float  # m    the foot's lift above the ground
    touchdown_speed: float = 0.0  # m/s    vertical, at the end of a swing
    narrowing: float = 0.0  # m    nearer to the hips under a load that the model does not have

    def __post_init__(self) -> None:
        for name, value, low, high in (
            ("period", self.period, 0.0, np.inf),
            ("duty", self.duty, 0.0, 1.0),
            ("step_height", self.step_height, 0.0, np.inf),
        ):
            check_type(value, Real, "a number", where=name)
            if not low < value < high:
                raise self._impossible(value, f"{low} < {name} < {high}")
        if not 0.0 <= self.narrowing < np.inf:
            raise self._impossible(self.narrowing, "0 <= narrowing < inf")
        if self.touchdown_speed < 0.0 or len(self.offsets) != len(AROUND_TO_LEGS):
            got = (self.touchdown_speed, len(self.offsets))
            raise self._impossible(got, "a touchdown_speed >= 0 and 6 offsets")

    def _impossible(self, got: object, expected: str) -> HexapodError:
        fix = "change this field"
        return HexapodError("impossible gait", got=got, expected=expected, fix=fix, where=self.name)

    def phase(self, clock: float) -> NDArray[np.float64]:
        """Returns the phases of the legs (6,) in [0, 1) at a gait clock in cycles."""
        return (np.array(self.offsets) + clock) % 1.0

    def stance(self, clock: float) -> NDArray[np.bool_]:
        """Returns the legs (6,) that stand at a gait clock in cycles."""
        return self.phase(clock) < self.duty

    def start_clock(self) -> float:
        """Returns the clock at which the legs of the largest offset lift off."""
        return self.duty - max(self.offsets)


def make_gait(
    robot: Robot,
    name: str | None = None,
    *,
    period: float | None = None,
    duty: float | None = None,
    step_height: float | None = None,
    touchdown_speed: float = 0.0,
) -> Gait:
    """Makes a gait by name; other arguments default to those of the robot's own gait.

    Another gait than the robot's gets the duty factor of its pattern. The default period keeps the
    duration of the robot's swing, so that the gait needs no higher joint speeds than the robot's
    own.

    Raises HexapodError: unknown name (with the nearest valid one), impossible values.
    """
    check_type(robot, Robot, "a Robot, as of load_robot()", where="robot")
    name = robot.gait.name if name is None else name
    check_type(name, str, "the name of a gait", where="name")
    if name not in PATTERNS:
        raise unknown_name("gait", name, GAITS)
    check_type(duty, (Real, NoneType), "a number", where="duty")
    if duty is None:
        duty = robot.gait.duty if name == robot.gait.name else PATTERNS[name].duty
    swing_time = robot.gait.period * (1.0 - robot.gait.duty)
    if period is None:
        period = (
            swing_time / (1.0 - duty)
            if 0.0 < duty < 1.0 and duty != robot.gait.duty
            else robot.gait.period
        )
    return Gait(
        name=name,
        period=period,
        duty=duty,
        offsets=PATTERNS[name].offsets,
        step_height=robot.gait.step_height if step_height is None else step_height,
        touchdown_speed=touchdown_speed,
    )
