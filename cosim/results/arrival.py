"""Judges whether a robot arrived at the end of the path that it was commanded to walk.

A robot that is stuck, at a stair or in snow, stands upright to the end of its run. Comparisons and
the course count it as a failure by the same rule: the path error, or the yaw drift of a turn on the
spot, is at most ARRIVE.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hexapod_cosim.cosim.results.window import LEAST_DISTANCE, LEAST_TURN, View

ARRIVE = 0.5  # m/m, rad/rad    largest path error, or yaw drift of a turn on the spot
SURELY = 2.0  # times the least walk: a shorter commanded way asks for no walk


def missed_end(metrics: Mapping[str, float], *, arrive: float = ARRIVE) -> str:
    """Returns how a run that was commanded to walk missed the end of its path; "" if it arrived.

    metrics: of a run with whole gait cycles after the first two.
    arrive: largest path error [m/m], or yaw drift [rad/rad] of a turn on the spot.
    """
    missed, unit = metrics["path_error"], "m per metre walked"
    if math.isnan(missed):
        missed, unit = metrics["yaw_drift_per_radian"], "rad per radian turned"
    if math.isnan(missed):
        return "the robot did not get ahead"
    if missed > arrive:
        return f"the robot did not arrive: it missed the end by {missed:.2g} {unit}"
    return ""


def is_sent_ahead(view: View) -> bool:
    """Returns whether the command of the measured cycles leads further than standing still does."""
    window = view.window
    if window is None:
        return False
    steps = np.diff(window.recording.time)
    vx, vy, rate = window.recording.columns(["command.vx", "command.vy", "command.yaw_rate"])[:-1].T
    way, turn = float(steps @ np.hypot(vx, vy)), float(steps @ np.abs(rate))
    return way >= SURELY * LEAST_DISTANCE or turn >= SURELY * LEAST_TURN
