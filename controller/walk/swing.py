"""Computes the shape of a swing (C6, C7) and the motion under a constant twist (C3). C: swing.h.

The flat top of the blend keeps the peak speed at 1.41 times the mean; the quintic of least jerk
needs 1.88 and a cycloid 2, which the joints of small servos do not reach.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hexapod_cosim.controller.plane import Array, Plane, cis

DWELL = 0.1  # 1    part of the swing at each end with vertical motion only, while the load changes
SMALL_ANGLE = 1e-12  # rad    below it sin(a)/a is 1


class Twist(NamedTuple):
    """Motion of the body at one step: the command with the addition of the path loop."""

    velocity: complex  # m/s    vx + i vy
    yaw_rate: float  # rad/s


def blend(tau: Array) -> tuple[Array, Array]:
    """Returns the horizontal progress s in [0, 1] at the parts tau of a swing, and ds/dtau (C6)."""
    y = np.minimum(np.maximum((2.0 * tau - 1.0) / (1.0 - 2.0 * DWELL), -1.0), 1.0)
    y4 = y * y * y * y
    flat = 1.0 - y4
    s = 0.5 + y * (45.0 + y4 * (5.0 * y4 - 18.0)) / 64.0
    return s, 45.0 / 32.0 * flat * flat / (1.0 - 2.0 * DWELL)


def hop(tau: Array, *, top: float, down: float) -> tuple[Array, Array]:
    """Returns the lift z of the foot at the parts tau of a swing, and dz/dtau [m] (C7).

    top: the step height; down: the touch-down speed times the duration of the swing [m].
    """
    arch = tau * (1.0 - tau)
    bow, fall = 64.0 * top * arch * arch, down * tau * tau
    climb = 3.0 * bow * (1.0 - 2.0 * tau) + fall * (3.0 - 4.0 * tau)
    return (bow + fall) * arch, climb


def travel(twist: Twist, time: Array | float) -> Plane:
    """Returns the displacement [m] after a time [s] of constant twist (C3)."""
    if twist.yaw_rate == 0.0:
        return np.asarray(twist.velocity * time)
    half = 0.5 * twist.yaw_rate * time
    arc = np.maximum(np.abs(half), SMALL_ANGLE)
    return np.asarray(twist.velocity * time * (np.sin(arc) / arc) * cis(half))


def odometry(last: Twist, twist: Twist, period: float) -> tuple[Plane, float]:
    """Returns displacement [m] and turn [rad] of the walking frame over a period [s] (C3).

    last: the motion of the body at its begin; twist: at its end.
    """
    mean = Twist(0.5 * (twist.velocity + last.velocity), 0.5 * (twist.yaw_rate + last.yaw_rate))
    return travel(mean, period), mean.yaw_rate * period
