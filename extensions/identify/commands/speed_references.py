"""Derives the speed commands that a log lacks from its angle commands.

A servo's law has kd times the commanded less the measured speed (eq. 12). The plant takes a command
that it does not get as 0, so that kd would brake each motion, and the fit would make up for it with
masses and gains far off. A servo whose derivative acts on the error of its angle gets the rate of
the commanded angle, which is what a log without speed commands is taken to mean.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.extensions.identify.log import Log
from hexapod_cosim.models import Robot


def with_speed_references(log: Log, robot: Robot) -> Log:
    """Returns the log with the rates of its angle commands as the speed commands that it lacks.

    A log of servos without kd, whose law has no speed command, is returned as it is.
    """
    pairs = zip(joint_names("speed_ref"), joint_names("angle_ref"), strict=True)
    missing = {name: angle for name, angle in pairs if not log.has([name])}
    if not missing or robot.servo.kd == 0.0:
        return log
    rates = [np.gradient(log.recording.column(angle), log.time) for angle in missing.values()]
    data = np.column_stack([log.recording.data, *rates])
    some = "" if len(missing) == len(joint_names("speed_ref")) else f" of {len(missing)} joints"
    note = (
        f"{log.where} has no speed commands{some} ({next(iter(missing))} [rad/s], ...), which the "
        "servo's kd needs: the rates of the commanded angles are taken. Give the columns; 0 in "
        "each row is right where the servo damps the measured speed alone."
    )
    recording = Recording((*log.recording.names, *missing), data)
    return replace(log, recording=recording, derived=note)
