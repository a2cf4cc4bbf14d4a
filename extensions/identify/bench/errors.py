"""How far a simulated servo is from bench logs, and from logs that its fit did not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexapod_cosim.extensions.identify.bench.fit import ServoFit
from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.extensions.identify.bench.pendulum import Bench, Swing
from hexapod_cosim.extensions.identify.report import rms
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.servos.motor import torque_per_volt


@dataclass(frozen=True)
class Errors:
    """Errors of a simulation over one log, or means over several."""

    angle: float  # deg  mean absolute error
    speed: float  # rad/s  likewise
    duty: float  # 1  likewise, while the torque is on
    torque: float  # 1  rms of the error of the motor's torque over the rms of the torque

    @staticmethod
    def mean(errors: Sequence[Errors]) -> Errors:
        """Returns the mean errors of logs."""
        table = [(one.angle, one.speed, one.duty, one.torque) for one in errors]
        return Errors(*np.mean(table, axis=0).tolist())


def log_errors(bench: Bench, swing: Swing, servo: Servo) -> list[Errors]:
    """Returns the errors of one servo's simulation over each log.

    Torques of the motor are those of the duties, voltages and speeds (eq. 48).
    """
    found = []
    for k, log in enumerate(bench.logs):
        rows, on = slice(0, len(log.time)), log.on > 0.0
        angle, speed, duty = (table[rows, 0, k] for table in (swing.angle, swing.speed, swing.duty))
        torque, true = (
            torque_per_volt(servo) * (d * log.voltage - servo.torque_constant * w)[on]
            for d, w in ((duty, speed), (log.duty, log.speed))
        )
        found.append(
            Errors(
                angle=float(np.degrees(np.mean(np.abs(angle - log.angle)))),
                speed=float(np.mean(np.abs(speed - log.speed))),
                duty=float(np.mean(np.abs(duty - log.duty)[on])),
                torque=rms(torque - true) / rms(true),
            )
        )
    return found


def judged(found: ServoFit, logs: Sequence[BenchLog]) -> list[Errors]:
    """Returns the errors of a fitted servo over each of some logs."""
    bench = Bench(logs)
    return log_errors(bench, found.swing(bench), found.robot.servo)
