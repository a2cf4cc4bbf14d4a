"""Compares servo presets and fits with logs of real servos on a pendulum bench that they did not
see, and with BAM's scheme; prints each row of the table in docs/reality.md.

usage: python -m benchmarks.identify.servos [--xl330 FOLDER] [--kscale FOLDER] [--pictures FOLDER]
       [--workers N] [-o FILE.csv]

The logs are not part of the repository: those of an XL330 (github.com/Rhoban/bam) are read from the
folder shared/data/servo_logs beside the repository, those of K-Scale (github.com/kscalelabs/sysid,
commit ca1ecb1) from a folder that is given. Of motors without logs there is a note, and the file
keeps the rows that it has.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from itertools import repeat, zip_longest
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from hexapod_cosim.extensions.identify.bench import read_bench_log
from hexapod_cosim.extensions.identify.bench.choice import Split, fitted_and_judged, splits
from hexapod_cosim.extensions.identify.bench.command import BenchReplay, drawn, with_start
from hexapod_cosim.extensions.identify.bench.errors import Errors, log_errors
from hexapod_cosim.extensions.identify.bench.fit import fit_servo
from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.extensions.identify.bench.pendulum import STEP, Bench
from hexapod_cosim.extensions.identify.numbers.servo import TERMS
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
FEW = ("m1", "m3", "m4", "m6")
MODELS = {"xl330": tuple(TERMS), "sts3215": FEW, "sts3250": FEW}
TRAJECTORIES = ("lift_and_drop", "sin_sin", "sin_time_square")  # of K-Scale's five
SEEN = ((0.535, 0.969), (8.0, 16.0, 32.0))  # masses [kg] and gains of K-Scale's that fits see
MOST = 72  # logs of a servo that a fit or a preset is judged on
COLUMNS = (
    "servo", "judged_on", "logs", "angle_deg", "speed_rad_s", "duty", "torque", "bam_angle_deg",
)  # fmt: skip


def found_logs(folder: Path | None, motor: str) -> list[BenchLog]:
    """Returns the logs of a motor in a folder and those below it."""
    paths = sorted(folder.rglob("*.json")) if folder else []
    logs = [read_bench_log(path) for path in paths if motor in _motors(path)]
    return [log for log in logs if motor == "xl330" or log.trajectory in TRAJECTORIES]


def run(log: BenchLog) -> tuple[float, float, float, str]:
    """Returns what repetitions of a run have in common."""
    return (log.mass, log.length, log.register, log.trajectory)


def some(logs: Sequence[BenchLog]) -> list[BenchLog]:
    """Returns at most MOST logs, evenly chosen."""
    return list(logs[:: max(1, -(-len(logs) // MOST))])


def divided(logs: Sequence[BenchLog]) -> dict[str, list[Split]]:
    """Returns the logs that fits see and those that they are judged on, by how they differ."""
    if logs[0].motor == "xl330":
        return {"gains held out in turn": splits(logs, "gain")}
    masses, gains = SEEN
    own: list[BenchLog] = []
    others: list[BenchLog] = []
    for log in logs:
        (own if log.mass in masses and log.register in gains else others).append(log)
    runs = {run(log): log for log in reversed(own)}  # the first of the repetitions
    short, long = ([log for log in runs.values() if log.length == m] for m in (0.1, 0.15))
    return {
        "other masses or gains": [([*short, *long], some(others))],
        "0.15 m, fitted to 0.1 m": [(short, long)],
    }


def _motors(path: Path) -> tuple[str, ...]:
    """Returns the motors that a log's file may be of, by its name."""
    named = [motor for motor in PRESETS if motor in path.name]
    return tuple(named) or ("xl330",)


def bam_angle(servo: Servo, logs: Sequence[BenchLog], offset: float, delay: float) -> float:
    """Returns the mean absolute error [degrees] of the published scheme, from its formulas: torques
    at the begin of a step, friction that stops the joint clipped to the budget, no firmware limits.
    """
    bench, plain = Bench(logs, step=0.25 * STEP), replace(servo, current_max=0.0)
    kp = servo.torque_constant / servo.resistance * servo.voltage * bench.gain
    angle, speed = bench.measured[0] + offset, bench.speed[0].copy()
    total = bench.inertia + servo.rotor_inertia
    errors = [np.zeros(len(angle))]
    goals = bench.goals(delay)[:, 0] + offset
    for row in range(len(bench.time) - 1):
        h = (bench.time[row + 1] - bench.time[row]) / bench.parts
        for goal in goals[row * bench.parts : (row + 1) * bench.parts]:
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


def repeated(motor: str, logs: Sequence[BenchLog]) -> dict[str, str]:
    """Returns the row of how far the second of two repetitions is from the first."""
    first: dict[Any, BenchLog] = {}
    pairs = [(first.setdefault(run(log), log), log) for log in logs]
    angles = [
        np.degrees(np.mean(np.abs(np.interp(one.time, other.time, other.angle) - one.angle)))
        for one, other in pairs
        if one is not other
    ]
    return _row(motor, "a second run of the same", len(angles), [float(np.mean(angles))])


def fitted(
    motor: str, models: Sequence[str], judged_on: str, parts: Sequence[Split], pool: Executor
) -> Iterator[dict[str, str]]:
    """Yields the rows of fits of friction models, each judged on logs that it did not see."""
    seen, unseen = zip(*parts, strict=True)
    robot = with_start(load_robot("athena"), seen[0])
    found = list(pool.map(fitted_and_judged, seen, unseen, repeat(robot), repeat(models)))
    for model in models:
        errors = [error for own in found for error in own[model]]
        mean = Errors.mean(errors)
        numbers = [mean.angle, mean.speed, mean.duty, mean.torque]
        yield _row(f"{motor}, {model} fitted", judged_on, len(errors), numbers)


def _row(servo: str, judged_on: str, logs: int, numbers: Sequence[float]) -> dict[str, str]:
    """Returns a row with the numbers that it has."""
    texts = [servo, judged_on, str(logs), *(f"{number:.3g}" for number in numbers)]
    return dict(zip_longest(COLUMNS, texts, fillvalue=""))


def compared(
    name: str, judged_on: str, logs: Sequence[BenchLog], pictures: Path | None
) -> dict[str, str]:
    """Returns the row of a preset; offset and delay of the bench are fitted to the logs."""
    servo = measured_servo(name).servo
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
            figure = drawn(BenchReplay(one, fitted.swing(one), fitted, errors[k]))
            path = pictures / f"servo-{name}-{word}.png"
            figure.savefig(path, dpi=120, metadata={"Software": None})
    numbers = [mean.angle, mean.speed, mean.duty, mean.torque, bam_angle(servo, logs, *values)]
    return _row(name, judged_on, len(logs), numbers)


def found_rows(
    xl330: Path, kscale: Path | None, pictures: Path | None, pool: Executor
) -> Iterator[dict[str, str]]:
    """Yields the rows of the motors that there are logs of."""
    for motor, presets in PRESETS.items():
        folder, variable = (xl330, "XL330") if motor == "xl330" else (kscale, "KSCALE")
        logs = found_logs(folder, motor)
        if not logs:
            place = f"in {folder}" if folder else "are named"
            print(f"{motor}: no logs {place}; make bench-servos {variable}=FOLDER")
            continue
        divisions = divided(logs)
        judged_on, (*_, (_, unseen)) = next(iter(divisions.items()))
        if motor == "xl330":
            judged_on, unseen = "all logs", logs
        for name in presets:
            yield compared(name, judged_on, unseen, pictures if name == "xl330_fitted" else None)
        models = MODELS[motor]
        for judged_on, parts in divisions.items():
            yield from fitted(motor, models, judged_on, parts, pool)
            models = models[-1:]  # of the further divisions
        if motor != "xl330":
            yield repeated(motor, logs)


def motor_of(row: Mapping[str, str]) -> str:
    """Returns the motor of a row of the table."""
    return row["servo"].replace(",", "_").partition("_")[0]


def with_kept(rows: Sequence[dict[str, str]], file: Path) -> list[dict[str, str]]:
    """Returns new rows, and those of other motors that a file has, in the order of PRESETS."""
    before: list[dict[str, str]] = []
    if file.exists():
        with file.open(encoding="utf-8", newline="") as table:
            before = list(csv.DictReader(table))
    new = {motor_of(row) for row in rows}
    kept = [row for row in before if motor_of(row) not in new]
    return sorted([*rows, *kept], key=lambda row: list(PRESETS).index(motor_of(row)))


def main() -> int:
    """Prints and writes the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--xl330", type=Path, default=XL330, help="folder of BAM's logs")
    parser.add_argument("--kscale", type=Path, help="folder of K-Scale's raw logs")
    parser.add_argument("--pictures", type=Path, help="where to draw two logs of xl330_fitted")
    parser.add_argument("-o", "--output", type=Path, help="CSV file")
    parser.add_argument("--workers", type=int, default=2, help="processes that fit")
    given = parser.parse_args()
    rows: list[dict[str, str]] = []
    with ProcessPoolExecutor(given.workers, mp_context=get_context("spawn")) as pool:
        for row in found_rows(given.xl330, given.kscale, given.pictures, pool):
            rows.append(row)
            print(", ".join(f"{key} {value}" for key, value in row.items() if value), flush=True)
    if given.output and rows:
        rows = with_kept(rows, given.output)
        given.output.parent.mkdir(parents=True, exist_ok=True)
        with given.output.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
