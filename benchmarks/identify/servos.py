"""Compares the servo presets with logs of real servos on a pendulum bench, and with BAM's scheme.

usage: python -m benchmarks.identify.servos [--kscale FOLDER] [--pictures FOLDER] [-o FILE.csv]

The logs are not part of the repository: those of an XL330 are read from ../shared/data/servo_logs,
those of K-Scale (github.com/kscalelabs/sysid, commit ca1ecb1) from a folder that is given. What is
not there is left out with a note.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from hexapod_cosim.extensions.identify.bench import read_bench_log
from hexapod_cosim.extensions.identify.bench.command import BenchReplay, drawn
from hexapod_cosim.extensions.identify.bench.errors import Errors, log_errors
from hexapod_cosim.extensions.identify.bench.fit import fit_servo
from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.extensions.identify.bench.pendulum import Bench
from hexapod_cosim.models import load_robot
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.servos.motor import friction_budget, motor_torque
from hexapod_cosim.models.servos.presets import measured_servo

XL330 = Path(__file__).parents[3] / "shared" / "data" / "servo_logs"
PRESETS = {
    "xl330": ("xl330_m1", "xl330_m3", "xl330_m4", "xl330_m6", "xl330_fitted"),
    "sts3215": ("sts3215_m1", "sts3215_12v"),
    "sts3250": ("sts3250",),
}
TRAJECTORIES = ("lift_and_drop", "sin_sin", "sin_time_square")
MOST = 72  # logs of a servo
COLUMNS = ("servo", "logs", "angle_deg", "speed_rad_s", "duty", "torque", "bam_angle_deg")


def found_logs(folder: Path | None, motor: str) -> list[BenchLog]:
    """Returns the logs of a motor in a folder and those below it, at most MOST, evenly chosen."""
    paths = sorted(folder.rglob("*.json")) if folder else []
    logs = [read_bench_log(path) for path in paths if motor in _motors(path)]
    if motor != "xl330":
        logs = [log for log in logs if log.trajectory in TRAJECTORIES]
    return logs[:: max(1, -(-len(logs) // MOST))]


def _motors(path: Path) -> tuple[str, ...]:
    """Returns the motors that a log's file may be of, by its name."""
    named = [motor for motor in PRESETS if motor in path.name]
    return tuple(named) or ("xl330",)


def bam_angle(servo: Servo, bench: Bench, offset: float, delay: float) -> float:
    """Returns the mean absolute error [degrees] of the published scheme, from its formulas: torques
    at the begin of a step, friction that stops the joint clipped to the budget, no firmware limits.
    """
    plain = replace(servo, current_max=0.0)
    kp = servo.torque_constant / servo.resistance * servo.voltage * bench.gain
    angle, speed = bench.measured[0] + offset, bench.speed[0].copy()
    total = bench.inertia + servo.rotor_inertia
    errors = [np.zeros(len(angle))]
    for row in range(len(bench.time) - 1):
        h = (bench.time[row + 1] - bench.time[row]) / (4 * bench.parts)
        for part in range(4 * bench.parts):
            goal = bench.goal(bench.time[row] + (part + 0.5) * h - delay)[0] + offset
            wanted = kp * (goal - angle) * bench.voltage[row] / servo.voltage
            motor = motor_torque(plain, speed, wanted) * bench.on[row]
            weight = -bench.weight * np.sin(angle)
            most = friction_budget(servo, speed, motor, weight)
            most = most + servo.viscous_friction * np.abs(speed)
            stop = total / h * speed + motor + weight
            net = motor + weight - np.sign(stop) * np.minimum(np.abs(stop), most)
            speed = speed + net / total * h
            angle = angle + speed * h
        errors.append(np.abs(angle - offset - bench.measured[row + 1]))
    degrees = np.degrees(np.array(errors))
    return float(
        np.mean([np.mean(own[rows]) for own, rows in zip(degrees.T, bench.counted.T, strict=True)])
    )


def compared(name: str, logs: Sequence[BenchLog], pictures: Path | None) -> dict[str, str]:
    """Returns the row of a preset; offset and delay of the bench are fitted to the logs."""
    servo = replace(measured_servo(name).servo, overload_time=0.0)
    fitted = fit_servo(logs, replace(load_robot("athena"), servo=servo), None, seeds=1)
    bench = Bench(logs)
    swing = fitted.swing(bench)
    errors = log_errors(bench, swing, servo)
    mean = Errors.mean(errors)
    values = list(fitted.values.values())
    if pictures:
        ordered = sorted(range(len(logs)), key=lambda k: errors[k].angle)
        for word, k in (("best", ordered[0]), ("worst", ordered[-1])):
            one = Bench([logs[k]])
            figure = drawn(BenchReplay(one, fitted.swing(one), servo, errors[k]))
            path = pictures / f"servo-{name}-{word}.png"
            figure.savefig(path, dpi=120, metadata={"Software": None})
    texts = [f"{value:.3g}" for value in (mean.angle, mean.speed, mean.duty, mean.torque)]
    row = [name, str(len(logs)), *texts, f"{bam_angle(servo, bench, *values):.3g}"]
    return dict(zip(COLUMNS, row, strict=True))


def main() -> int:
    """Prints and writes the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--kscale", type=Path, help="folder of K-Scale's raw logs")
    parser.add_argument("--pictures", type=Path, help="where to draw two logs of xl330_fitted")
    parser.add_argument("-o", "--output", type=Path, help="CSV file")
    given = parser.parse_args()
    rows = []
    for motor, presets in PRESETS.items():
        logs = found_logs(XL330 if motor == "xl330" else given.kscale, motor)
        if not logs:
            print(f"{motor}: no logs here; see {XL330} and --kscale")
            continue
        for name in presets:
            rows.append(compared(name, logs, given.pictures if name == "xl330_fitted" else None))
            print(", ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    if given.output and rows:
        given.output.parent.mkdir(parents=True, exist_ok=True)
        with given.output.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
