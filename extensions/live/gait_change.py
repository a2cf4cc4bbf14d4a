"""A change of gait while the robot walks: how fast it walks meanwhile, and when things are due.

Feet stand longer during a change than in either gait and need more reach (docs/control/gait.md,
C55). So the robot walks slowly from the request until every leg has made a step in the next gait.
The server's loop and the page without a server both follow the plan that is made here.
"""

from __future__ import annotations

from dataclasses import dataclass

from hexapod_cosim.controller import Gait
from hexapod_cosim.extensions.live.settings import Limits, find_limits
from hexapod_cosim.models import Robot

# of the commands that both gaits allow: no leg reaches its limits (docs/control/gait.md)
SHARE = 0.3


@dataclass(frozen=True)
class GaitChange:
    """The plan of a change; times since the request."""

    limits: Limits  # of commands until `end`
    begin: float  # s    the robot is slow, and the controller gets the next gait
    settled: float  # s    no leg steps in the gait before
    end: float  # s    each leg has made its first step in the next gait


def plan_change(robot: Robot, before: Gait, after: Gait) -> GaitChange:
    """Returns the plan of a change between two gaits of a robot."""
    limits = find_limits(robot, before).least(find_limits(robot, after)).times(SHARE)
    swing = before.period * (1.0 - before.duty)
    begin = before.period  # the ramp to a slower command takes a gait period (C1)
    settled = begin + swing
    return GaitChange(limits, begin, settled, settled + swing + after.period)
