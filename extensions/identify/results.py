"""Writes an identification into a folder, robot file, sensors and results; and says in words what
was found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomlkit

from hexapod_cosim.cosim.common.files import RUN_FILE, write_json, write_text
from hexapod_cosim.extensions.identify.identification import Estimate, Identified
from hexapod_cosim.extensions.identify.report import TITLES, Difference, number
from hexapod_cosim.extensions.identify.robot_file import write_robot
from hexapod_cosim.extensions.identify.screening import left_out
from hexapod_cosim.extensions.identify.unknowns import BIAS

KIND, ROBOT_FILE, SENSORS, RESULT = "identify", "robot.toml", "sensors.toml", "identify.json"
FILES = (ROBOT_FILE, SENSORS, RESULT)
ESTIMATES = ("number", "unit", "before", "found", "95 % interval", "determined")
ERRORS = ("channel", "unit", "before", "after", "ratio", "noise", "squares over noise")
MOTOR = {"servo.torque_constant", "servo.resistance"}


def write_identified(found: Identified, file: str, folder: Path, *, command: str) -> list[Path]:
    """Writes robot.toml, sensors.toml, identify.json and run.json; returns the files.

    file: the robot file that was given.
    """
    logs = [one.log.where for one in found.experiments]
    write_robot(found, file, folder / ROBOT_FILE, logs)
    write_text(folder / SENSORS, tomlkit.dumps(dict(sensors_table(found))))
    write_json(folder / RESULT, result_table(found))
    robot = {"name": found.file.name, "hash": found.file.hash}
    facts = {"kind": KIND, "status": "completed", "logs": logs, "robot": robot, "command": command}
    write_json(folder / RUN_FILE, facts)
    return [folder / name for name in (ROBOT_FILE, SENSORS, RESULT, RUN_FILE)]


def sensors_table(found: Identified) -> Mapping[str, Any]:
    """Returns the numbers of the sensors, by key, with their intervals."""
    names = ("value", "low", "high", "unit", "determined")
    return {
        one.key: {name: getattr(one, name) for name in names}
        for one in found.estimates
        if one.group in ("sensor", "zero")
    }


def result_table(found: Identified) -> dict[str, Any]:
    """Returns everything that was found, for JSON."""
    return {
        "estimates": [{**asdict(one), "determined": one.determined} for one in found.estimates],
        "rank": found.fit.rank,
        "unknowns": len(found.fit.rows),
        "noise": dict(found.fit.noise),
        "deviations_from_optimum": found.fit.decrement,
        "mean_square_over_noise": {
            "fitted": {key: one.value for key, one in found.fit.misfit.items()},
            "held_out": {key: one.value for key, one in found.fit.held_out.items()},
        },
        "unexplained": found.fit.unexplained,
        "bad_columns": [
            {"log": found.experiments[number].log.where, **asdict(column)}
            for number, column in found.bad
        ],
        "held_out": _error_table(found.differences("held_out")),
        "fitted": _error_table(found.differences("fitted")),
    }


def _error_table(pairs: Sequence[tuple[Difference, Difference]]) -> list[dict[str, Any]]:
    return [
        {"channel": one.channel, "unit": one.unit, "before": one.rms, "after": other.rms}
        for one, other in pairs
    ]


def error_rows(found: Identified) -> list[list[str]]:
    """Returns the rows of a table with ERRORS: of held-out rows, or of all without any.

    Errors are root mean squares of simulated minus measured. The last column has mean squares of
    the residuals over those of the readings' noise: 1 where the model explains the readings.
    """
    part, misfit = "held_out", found.fit.held_out
    if not misfit:
        part, misfit = "fitted", found.fit.misfit
    return [
        [TITLES[one.channel], one.unit, number(one.rms), number(other.rms),
         f"{one.rms / other.rms:.1f}" if other.rms > 0.0 else "",
         number(found.fit.noise[one.channel]), f"{misfit[one.channel].value:.2f}"]
        for one, other in found.differences(part)
    ]  # fmt: skip


def estimate_rows(estimates: Sequence[Estimate]) -> tuple[list[list[str]], int]:
    """Returns the rows of a table with ESTIMATES, and how many biases that may be 0 it lacks."""
    shown = [
        [one.key, one.unit, number(one.before), one.found, one.interval,
         "yes" if one.determined else "no"]
        for one in estimates
        if not (one.key.startswith(BIAS) and one.low <= 0.0 <= one.high and one.determined)
    ]  # fmt: skip
    return shown, len(estimates) - len(shown)


def open_text(found: Identified) -> str:
    """Returns what the logs do not determine, as sentences."""
    missing = [one.key for one in found.estimates if not one.determined]
    text = (
        f"The logs determine {found.fit.rank} independent combinations of {len(found.fit.rows)} "
        "numbers better than the robot file. "
    )
    text += f"Not determined: {', '.join(missing)}." if missing else "They determine every number."
    if MOTOR & set(missing) and not any("current" in one.channels for one in found.experiments):
        text += (
            " Currents would determine both the motor's torque constant and its resistance: "
            "record LF.coxa.current [A], ..."
        )
    return text


def warnings(found: Identified) -> list[str]:
    """Returns what a user must know of the result, as sentences."""
    texts = [text for one in found.experiments for text in one.log.warnings]
    for one in found.experiments:
        texts += left_out([column for number, column in found.bad if number == one.number])
    if found.fit.decrement > 1.0:
        texts.append(
            f"The search ended {found.fit.decrement:.1f} deviations before the optimum of the "
            "linearised problem. The intervals contain this step, but are a guess: give a longer "
            "log, or begin again from the robot file that was written."
        )
    if found.fit.unexplained:
        channels = ", ".join(
            f"{TITLES[key].lower()} ({value:.1f})" for key, value in found.fit.unexplained.items()
        )
        texts.append(
            "The model does not explain this log: mean squares of residuals over those of the "
            f"readings' noise are too large in {channels}. The intervals are wider for it, but may "
            "miss the true numbers: find all groups of numbers, look at the curves that "
            "`hexapod replay` draws, or choose another model of servo (--friction) or ground."
        )
    return texts
