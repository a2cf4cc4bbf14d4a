"""Defines the switches of the parts of both force controls, and the weight of the squeeze.

Each part can be switched by itself, so that its effect can be measured.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated

from hexapod_cosim.models.schema import Flag, Number

Switch = Annotated[bool, Flag()]


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Switches; they have no effect on kinematic control."""

    support: Switch = True  # servo torques that carry each leg's share of weight and acceleration
    # of the paper's control: a share of the deviations of the feet is taken back
    paper_share: Switch = True
    paper_pid: Switch = True  # of the paper's control: feet yield to forces, and return to the plan
    # of the paper's control: a foot yields where it meets the ground early, extends where late
    paper_suspension: Switch = True
    touchdown: Switch = True  # foot heights follow early and late touch-downs
    posture: Switch = True  # roll, pitch and height are controlled
    # under a payload the torso moves against the swinging legs: feet need not push for them
    sway: Switch = True
    path: Switch = True  # the path walked is measured at the feet, and its deviation corrected
    limits: Switch = True  # torques are limited
    # no feedback from a sensor that contradicts the plan; kinematic control while the robot slides,
    # its joints cannot follow, or it is far too heavy for them
    fallback: Switch = True
    # weight of the servos' torques against the feet's use of friction in the planned squeeze, in
    # [0, 1), on ground on which feet creep: a part of `support`
    squeeze: Annotated[float, Number("1", at_least=0.0, at_most=0.99)] = 0.3


SWITCHES = tuple(item.name for item in fields(Parts) if item.name != "squeeze")
COMPLIANT_PARTS = tuple(name for name in SWITCHES if not name.startswith("paper_"))
