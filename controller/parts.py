"""Which parts of the compliant control are at work.

Each can be switched off by itself, so that its share of the benefit can be measured.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Switches, all on by default; they mean nothing to kinematic control."""

    support: bool = True  # servo torques that carry each leg's share of weight and acceleration
    slip_pid: bool = True  # feet give way to squeezing tangential forces
    suspension: bool = True  # legs give way to normal forces beyond their share
    touchdown: bool = True  # early and late touch-downs are answered
    posture: bool = True  # roll, pitch and height are held
    path: bool = True  # the walked way is measured at the feet and held to the command
    limits: bool = True  # corrections are limited in rate and torque
    # no feedback from a sensor that contradicts the plan; kinematic control of a robot that slides,
    # outruns its joints or is far too heavy for them
    fallback: bool = True
