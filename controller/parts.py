"""Defines the switches of the parts of both force controls, and the weight of the squeeze.

Each part can be switched by itself, so that its effect can be measured.
"""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Switches; they have no effect on kinematic control."""

    support: bool = True  # servo torques that carry each leg's share of weight and acceleration
    slip_pid: bool = True  # of the paper's control: feet yield to tangential forces
    paper_suspension: bool = True  # of the paper's control: legs yield to normal forces
    touchdown: bool = True  # foot heights follow early and late touch-downs
    posture: bool = True  # roll, pitch and height are controlled
    # under a payload the torso moves against the swinging legs: feet need not push for them
    sway: bool = True
    path: bool = True  # the path walked is measured at the feet, and its deviation corrected
    limits: bool = True  # torques are limited
    # no feedback from a sensor that contradicts the plan; kinematic control while the robot slides,
    # its joints cannot follow, or it is far too heavy for them
    fallback: bool = True
    # weight of the servos' torques against the feet's use of friction in the planned squeeze, in
    # [0, 1), on ground on which feet creep: a part of `support`
    squeeze: float = 0.3


SWITCHES = tuple(item.name for item in fields(Parts) if item.name != "squeeze")
COMPLIANT_PARTS = tuple(name for name in SWITCHES if name not in ("slip_pid", "paper_suspension"))
