"""Warnings of servos that became so hot in a run that they gave less torque."""

from __future__ import annotations

import numpy as np

from hexapod_cosim.cosim.interface.names import joint_names
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.models.records import Servo


def heat_warnings(recording: Recording, servo: Servo) -> list[str]:
    """Warns of windings that were above the temperature from which on the duty limit falls.

    recording: without temperatures, as of a run that records metrics alone, nothing is said.
    """
    names = joint_names("winding_temperature")
    if servo.winding_capacity == 0.0 or not set(names) <= set(recording.names):
        return []
    windings = recording.columns(names)  # (rows, joints) [K]
    hot = windings.max(axis=0) > servo.derate_temperature
    if not hot.any():
        return []
    first = int(np.argmax((windings > servo.derate_temperature).any(axis=1)))
    worst = names[int(np.argmax(windings.max(axis=0)))].removesuffix(".winding_temperature")
    return [
        f"{int(hot.sum())} of {len(names)} servos gave less torque because they were hot, from "
        f"{recording.time[first]:.3g} s on: the winding of {worst} reached {windings.max():.1f} K "
        f"(servo.derate_temperature {servo.derate_temperature:g} K, servo.temperature_max "
        f"{servo.temperature_max:g} K)"
    ]
