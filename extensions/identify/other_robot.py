"""Tells whether a log is that of another robot, where its readings say so safely.

Servos follow the commands of any robot, so that joint angles tell nothing. The height at which legs
hold the torso and the weight on the feet do.
"""

from __future__ import annotations

import numpy as np

from hexapod_cosim.cosim.interface.names import foot_names, vector_names
from hexapod_cosim.extensions.identify.log import Log
from hexapod_cosim.extensions.identify.start import initial_state, rest_rows
from hexapod_cosim.models import Robot

HEIGHT = 0.03  # m    of the torso from where the legs of the robot hold it
WEIGHT = 1.5  # factor between the forces on the feet and the weight; masses are known to 20 %


def other_robot(log: Log, robot: Robot) -> str:
    """Returns why a log is not that of a robot, as a sentence; empty where nothing says so."""
    if robot.terrain.kind != "flat":
        return ""
    facts = [fact for fact in (_height(log, robot), _weight(log, robot)) if fact]
    if not facts:
        return ""
    return (
        f"{log.where} may be the log of another robot than {robot.name}: {'; '.join(facts)}. "
        "Give the file of its robot (--robot)."
    )


def _height(log: Log, robot: Robot) -> str:
    """Returns how the torso's height at rest is another one; empty if it is not."""
    place = vector_names("torso.position")
    if not log.has(place):
        return ""
    measured = float(np.nanmedian(log.recording.column(place[2])[: rest_rows(log)]))
    held = initial_state(log.without(place), robot)["initial.position[3]"]
    if not abs(measured - held) > HEIGHT:
        return ""
    return (
        f"its torso is at {measured:.3g} m, where the legs of {robot.name} hold it at {held:.3g} m"
    )


def _weight(log: Log, robot: Robot) -> str:
    """Returns how the forces on all feet are another weight; empty if they are not."""
    names = foot_names("normal_force")
    if not log.has(names):
        return ""
    force = float(np.nanmedian(log.recording.columns(names).sum(axis=1)))
    if robot.weight / WEIGHT < force < robot.weight * WEIGHT or not force > 0.0:
        return ""
    return f"its feet carry {force:.3g} N, and {robot.name} weighs {robot.weight:.3g} N"
