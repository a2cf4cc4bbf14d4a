"""What `hexapod identify servo` and `hexapod replay` do with logs of a servo bench."""

from __future__ import annotations

import datetime
import textwrap
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, fields, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from hexapod_cosim.controller.figure_style import PALETTE, SETTINGS, WIDTH
from hexapod_cosim.cosim.common.files import RUN_FILE, write_json, write_text
from hexapod_cosim.cosim.report.page import render
from hexapod_cosim.extensions.identify.bench import read_bench_log
from hexapod_cosim.extensions.identify.bench.choice import Choice, choose
from hexapod_cosim.extensions.identify.bench.errors import Errors, log_errors
from hexapod_cosim.extensions.identify.bench.fit import ServoFit, fit_servo
from hexapod_cosim.extensions.identify.bench.log import BenchLog
from hexapod_cosim.extensions.identify.bench.pendulum import Bench, Swing
from hexapod_cosim.extensions.identify.numbers.servo import STRIBECK, TERMS
from hexapod_cosim.extensions.identify.report import embedded, number
from hexapod_cosim.models import HexapodError, Robot
from hexapod_cosim.models.records import Servo
from hexapod_cosim.models.servos.motor import torque_per_volt
from hexapod_cosim.models.servos.presets import FOLLOWING, followed, list_servos, measured_servo

PRESETS = {"xl330": "xl330_fitted", "sts3215": "sts3215_12v", "sts3250": "sts3250"}  # of motors
# Where a fit begins: servos that others published, with the makers' stall currents [A] and no-load
# speeds [rad/s] (data sheets of XL330-M288-T, ST-3215-C018: 0.222 s for 60 degrees, and STS3250:
# 0.133 s). None comes from the logs that a fit may be judged on.
STILL = {"friction_speed": 3e-4}  # rad/s  a joint that friction holds creeps at most so fast
STS = {**STILL, "voltage": 12.0, "overload_time": 1.0, "overload_duty": 0.8, "overload_left": 0.2}
STARTS: dict[str, tuple[str, dict[str, Any]]] = {
    "xl330": ("xl330_m4", {"current_max": 1.47, **STILL}),
    "sts3215": ("sts3215_m1", {"goal_speed_max": 4.7, "current_max": 2.7, **STS}),
    "sts3250": ("sts3215_m1", {"goal_speed_max": 7.9, "current_max": 2.4, **STS}),
}
SERVO, RESULT, REPORT = "servo.toml", "identify.json", "report.html"
NUMBERS = ("number", "unit", "start", "found", "95 % interval")
ERRORS = ("angle [deg]", "speed [rad/s]", "duty", "torque")
# of a servo's table these follow from the others; kp from duty_gain
DERIVED = ("mode", "drive", "kp", "kd", *FOLLOWING)
CURVE = ("stribeck_speed", "stribeck_exponent")  # without a term of STRIBECK they are unused
MOTOR = ("torque_constant", "resistance", "rotor_inertia")  # tell one measured servo from another


def with_start(robot: Robot, logs: Sequence[BenchLog], *, preset: bool = False) -> Robot:
    """Returns the robot with the servo that a fit to logs begins at: its own measured one, or
    that of STARTS for the logs' motor, or of PRESETS.
    """
    motor = logs[0].motor
    if robot.servo.drive == "motor":
        return robot
    name, changed = (PRESETS[motor], {}) if preset else STARTS[motor]
    return replace(robot, servo=followed(replace(measured_servo(name).servo, **changed)))


def servo_name(robot: Robot) -> str:
    """Returns the name of the measured servo whose motor a robot has, or the robot's."""
    own = [getattr(robot.servo, key) for key in MOTOR]
    for name in list_servos():
        if own == [getattr(measured_servo(name).servo, key) for key in MOTOR]:
            return name
    return f"that of robot {robot.name}"


def motor_warnings(robot: Robot, motor: str) -> list[str]:
    """Returns a warning if a robot's servo is known to be of another motor than a log."""
    name = servo_name(robot)
    if name not in list_servos() or name.startswith(motor):
        return []
    return [f"the log is of a {motor}, but the servo of robot {robot.name} is {name}."]


def identified_servo(
    paths: Sequence[Path],
    robot: Robot,
    *,
    friction: str | None,
    by: str,
    workers: int,
    progress: Callable[[str], None],
) -> Choice:
    """Reads bench logs and fits their servo. Raises HexapodError."""
    logs = [read_bench_log(path) for path in paths]
    motors = sorted({log.motor for log in logs})
    if len(motors) > 1:
        got, fix = ", ".join(motors), "identify each motor with its own logs"
        raise HexapodError("logs of several motors", got=got, expected="one motor", fix=fix)
    models = [friction] if friction else list(TERMS)
    robot = with_start(robot, logs)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        return choose(logs, robot, pool, by=by, models=models, progress=progress)


def result_table(found: Choice) -> dict[str, Any]:
    """Returns everything that was found, for JSON."""
    fit = found.fit
    return {
        "model": found.model,
        "start": {"servo": servo_name(found.robot), **asdict(found.start)},
        "models": {key: asdict(one) for key, one in found.models.items()},
        "held_out": asdict(found.models[found.model]),
        "logs": {log.where: asdict(one) for log, one in found.held_out},
        "numbers": {
            key: {"value": value, "start": fit.before[key], "interval": fit.interval(key)}
            for key, value in fit.values.items()
        },
    }


def number_rows(found: Choice) -> list[list[str]]:
    """Returns the rows of a table with NUMBERS."""
    fit = found.fit
    return [
        [row.key, row.unit, number(fit.before[row.key]), number(fit.values[row.key]),
         " to ".join(map(number, fit.interval(row.key)))]
        for row in fit.rows
    ]  # fmt: skip


def error_rows(found: Choice) -> list[list[str]]:
    """Returns the rows of a table of models with ERRORS."""
    rows = {"start": found.start, **found.models}
    return [[key, *error_texts(one)] for key, one in rows.items()]


def error_texts(one: Errors) -> list[str]:
    """Returns the texts of ERRORS."""
    return [number(getattr(one, item.name)) for item in fields(Errors)]


def worth(found: Choice, by: str) -> str:
    """Returns which model is worth it and what it and the start err by, as sentences."""
    error = found.models[found.model]
    compared = "the simplest model within 5 % of the best, and " if len(found.models) > 1 else ""
    beaten = error.angle < found.start.angle
    verdict = "." if beaten else ", and no model errs less: keep that servo, or record more logs."
    return (
        f"{found.model} is {compared}fitted to {len(found.held_out)} logs: held out by {by} in "
        f"turn it errs by {error.angle:.2f} degrees, {error.speed:.2f} rad/s and "
        f"{error.torque:.2f} of the torque. The servo that the search began at, "
        f"{servo_name(found.robot)}, errs by {found.start.angle:.2f} degrees{verdict}"
    )


def write_servo(found: Choice, folder: Path, *, command: str, by: str) -> list[Path]:
    """Writes servo.toml, identify.json and run.json; returns the files."""
    write_text(folder / SERVO, servo_text(found, by))
    write_json(folder / RESULT, result_table(found))
    logs = [log.where for log, _ in found.held_out]
    write_json(folder / RUN_FILE, {
        "kind": "identify", "status": "completed", "logs": logs, "command": command,
    })  # fmt: skip
    return [folder / name for name in (SERVO, RESULT, RUN_FILE)]


def servo_text(found: Choice, by: str) -> str:
    """Returns a [servo] section of a robot file with the servo that was found, and its source."""
    servo, logs = found.fit.robot.servo, [log for log, _ in found.held_out]
    largest = max(logs, key=lambda log: log.gain)
    names = ", ".join(Path(log.where).name for log in logs)
    about = (
        f"{logs[0].motor}, {datetime.date.today().isoformat()}. {worth(found, by)} duty_gain is "
        f"that of a firmware gain of {largest.register:g}. Logs: {names}"
    )
    unused = DERIVED if any(getattr(servo, key) for key in STRIBECK) else (*DERIVED, *CURVE)
    values = {item.name: getattr(servo, item.name) for item in fields(Servo)
              if item.name not in unused and getattr(servo, item.name) != item.default}  # fmt: skip
    rounded = {key: float(f"{one:.7g}") for key, one in values.items()}
    table = {"drive": "motor", **rounded, "duty_gain": float(f"{largest.gain:.7g}")}
    lines = textwrap.wrap(about, 98, break_long_words=False, break_on_hyphens=False)
    return "".join(f"# {line}\n" for line in lines) + tomlkit.dumps({"servo": table})


@dataclass(frozen=True)
class BenchReplay:
    """A bench log and the simulation of it."""

    bench: Bench
    swing: Swing
    fit: ServoFit  # of the bench: offset and delay
    errors: Errors
    warnings: Sequence[str] = ()


def replayed(path: Path, robot: Robot) -> BenchReplay:
    """Simulates a bench log with the robot's servo; offset and delay of the bench are fitted."""
    log = read_bench_log(path)
    found = fit_servo([log], with_start(robot, [log], preset=True), None, seeds=1)
    bench = Bench([log])
    swing = found.swing(bench)
    (errors,) = log_errors(bench, swing, found.robot.servo)
    return BenchReplay(bench, swing, found, errors, motor_warnings(robot, log.motor))


def write_replay(done: BenchReplay, folder: Path, *, command: str) -> list[Path]:
    """Writes the page and run.json of a replayed bench log; returns the files."""
    log, fit = done.bench.logs[0], done.fit
    fitted = {row.key: f"{number(fit.values[row.key])} {row.unit}" for row in fit.rows}
    servo = servo_name(fit.robot)
    page = render(
        "log.html.jinja",
        package="hexapod_cosim.extensions.identify",
        title=f"Replay of {Path(log.where).name}",
        headline=f"{log.motor}, gain {log.register:g}, {log.trajectory}, {log.mass:g} kg at "
        f"{log.length:g} m",
        lead="Mean absolute errors; of the torque the error's share of its root mean square. "
        f"{' and '.join(fitted)} were fitted to the log.",
        warnings=done.warnings,
        columns=("log", "", *ERRORS),
        tables={"Errors": [[log.where, "", *error_texts(done.errors)]]},
        pictures={"Angle, speed, duty and motor torque": embedded(drawn(done))},
        command=command,
        facts={"log": log.where, "servo": servo, **fitted},
        source=RUN_FILE,
    )
    write_text(folder / REPORT, page)
    write_json(folder / RUN_FILE, {
        "kind": "replay", "status": "completed", "log": log.where, "command": command,
        "servo": servo, "bench": fit.values, "errors": asdict(done.errors),
        "warnings": list(done.warnings),
    })  # fmt: skip
    return [folder / REPORT, folder / RUN_FILE]


def drawn(done: BenchReplay) -> Any:
    """Returns a figure of the first log's readings and of what was simulated."""
    from matplotlib import rc_context  # noqa: PLC0415  slow to import
    from matplotlib.figure import Figure  # noqa: PLC0415

    log, swing, servo = done.bench.logs[0], done.swing, done.fit.robot.servo
    rows = slice(0, len(log.time))
    angle, speed, duty = (own[rows, 0, 0] for own in (swing.angle, swing.speed, swing.duty))
    constant, gain = servo.torque_constant, torque_per_volt(servo)
    panels = {
        "angle [rad]": (log.angle, angle),
        "speed [rad/s]": (log.speed, speed),
        "duty": (log.duty, duty),
        "torque [N m]": (
            gain * (log.duty * log.voltage - constant * log.speed) * log.on,
            gain * (duty * log.voltage - constant * speed) * log.on,
        ),
    }
    with rc_context(SETTINGS):
        figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
        axes = np.atleast_1d(figure.subplots(len(panels), 1, sharex=True))
        axes[0].plot(log.time, log.goal, color="0.8", linewidth=0.8, label="goal")
        for axis, (title, (measured, simulated)) in zip(axes, panels.items(), strict=True):
            axis.plot(log.time, measured, color="0.45", linewidth=1.2, label="measured")
            axis.plot(log.time, simulated, color=PALETTE[3], linewidth=0.8, label="simulated")
            axis.set_ylabel(title, fontsize=6.5)
        axes[0].legend(fontsize=6.0, ncols=3)
        axes[-1].set_xlabel("time [s]")
    return figure
