"""A change of gait while the robot walks: when the controller is told, and how fast the robot walks
meanwhile.

Feet stand longer during a change than in either gait and need more reach (docs/control/gait.md,
C55). So the robot walks slowly from the request until every leg has made a step in the next gait.
"""

from __future__ import annotations

from dataclasses import dataclass

from hexapod_cosim.controller import BodyCommand, Gait
from hexapod_cosim.extensions.live.settings import Limits

# of the commands that both gaits allow: no leg reaches its limits (docs/control/gait.md)
SHARE = 0.3
ROUNDING = 1e-9


@dataclass
class GaitChange:
    """The macro-steps that are left until the controller is told, the gait holds and all is over.

    The limits hold until then.
    """

    limits: Limits
    tell: int
    hold: int
    end: int

    def advance(self) -> None:
        """Counts a macro-step."""
        self.tell, self.hold, self.end = self.tell - 1, self.hold - 1, self.end - 1


def begin_change(
    before: Gait,
    after: Gait,
    *,
    limits: tuple[Limits, ...],
    command: BodyCommand,
    held: float,
    h: float,
) -> GaitChange:
    """Plans a change of gait.

    Args:
        before, after: gaits.
        limits: present ones, those of both gaits.
        command: of the last macro-step.
        held: time for which it has not changed [s].
        h: macro-step [s].
    """
    present, *both = limits
    slow = both[0].least(both[1]).times(SHARE).least(present)
    # the ramp to a slower command takes a gait period (C1)
    ramp = before.period if slow.share(command) > 1.0 + ROUNDING else before.period - held
    swing = before.period * (1.0 - before.duty)
    tell = max(round(ramp / h), 0)
    hold = tell + max(round(swing / h), 1)
    return GaitChange(slow, tell, hold, hold + round((swing + after.period) / h))
