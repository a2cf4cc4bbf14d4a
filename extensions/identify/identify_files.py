"""Writes an identification into a folder: robot file, sensors, figures, report; and says in words
what was found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomlkit

from hexapod_cosim.cosim.common.files import RUN_FILE, write_json, write_text
from hexapod_cosim.extensions.identify.fitting.misfit import EXPLAINED, REJECTED
from hexapod_cosim.extensions.identify.identify import Estimate, Identified
from hexapod_cosim.extensions.identify.numbers.servo import GEAR
from hexapod_cosim.extensions.identify.report import (
    TITLES,
    Difference,
    Section,
    channel_figures,
    number,
    rendered,
)
from hexapod_cosim.extensions.identify.robot_file import SENSORS, sensors_table, write_robot
from hexapod_cosim.extensions.identify.screening import left_out
from hexapod_cosim.extensions.identify.unknowns import BIAS

KIND, ROBOT_FILE, REPORT, RESULT = "identify", "robot.toml", "report.html", "identify.json"
FILES = (ROBOT_FILE, SENSORS, RESULT)
ESTIMATES = ("number", "unit", "before", "found", "95 % interval", "determined")
ERRORS = ("channel", "unit", "before", "after", "ratio", "noise", "squares over noise")
MOTOR = {"servo.torque_constant", "servo.resistance"}


def write_identified(found: Identified, file: str, folder: Path, *, command: str) -> list[Path]:
    """Writes robot.toml, sensors.toml, identify.json, the report and run.json; returns the files.

    file: the robot file that was given.
    """
    logs = [one.log.where for one in found.experiments]
    write_robot(found, file, folder / ROBOT_FILE, logs)
    write_text(folder / SENSORS, tomlkit.dumps(dict(sensors_table(found))))
    write_json(folder / RESULT, result_table(found))
    write_text(folder / REPORT, _page(found, command))
    facts = {
        "kind": KIND,
        "status": "completed",
        "logs": logs,
        "robot": {"name": found.file.name, "hash": found.file.hash},
        "command": command,
    }
    write_json(folder / RUN_FILE, facts)
    return [folder / name for name in (ROBOT_FILE, SENSORS, RESULT, REPORT, RUN_FILE)]


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
        "rejected": found.fit.rejected,
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


def _page(found: Identified, command: str) -> str:
    estimates = found.estimates
    determined = [one for one in estimates if one.determined]
    logs = [one.log.where for one in found.experiments]
    sections = [
        Section(
            title="Held-out rows",
            caption="Root mean squares of simulated minus measured over the rows that the fit did "
            "not see, before and after; they contain the noise of the sensors. The last column has "
            "mean squares of the residuals over those of this noise: 1 where the model explains "
            f"the readings. Above {EXPLAINED:g} (more where readings are few) the page warns.",
            columns=ERRORS,
            rows=error_rows(found),
            left=2,
        ),
        Section(
            title="Numbers",
            caption="Determined: the logs at least halve what was unknown of a number.",
            columns=ESTIMATES,
            rows=estimate_rows(estimates),
            left=2,
        ),
        Section(title="What the logs do not determine", caption=open_text(found)),
        Section(
            title="Measured and simulated",
            caption="The rows right of the vertical line were held out.",
            pictures=_figures(found),
        ),
    ]
    return rendered(
        sections,
        title=f"Robot {found.file.name} identified from its logs",
        headline=f"The logs determine {len(determined)} of {len(estimates)} numbers",
        lead="Each number is the most probable one, given the readings and the robot file.",
        warnings=warnings(found),
        command=command,
        facts={
            "logs": ", ".join(logs),
            "rows": ", ".join(str(len(one.log.time)) for one in found.experiments),
        },
        source=RESULT,
    )


def _figures(found: Identified) -> dict[str, str]:
    """Returns the figures of the first log."""
    first = found.experiments[0]
    simulations = {
        label: dict(zip(first.columns, own[0].T, strict=True))
        for label, own in (("before", found.before), ("after", found.fit.predictions))
    }
    time = first.log.time[first.held_out]
    return channel_figures(first.log, simulations, split=float(time[0]) if len(time) else None)


def error_rows(found: Identified) -> list[list[str]]:
    """Returns the rows of a table with ERRORS: of held-out rows, or of all without any."""
    part, misfit = "held_out", found.fit.held_out
    if not misfit:
        part, misfit = "fitted", found.fit.misfit
    return [
        [
            TITLES[one.channel],
            one.unit,
            number(one.rms),
            number(other.rms),
            f"{one.rms / other.rms:.1f}" if other.rms > 0.0 else "",
            number(found.fit.noise[one.channel]),
            f"{misfit[one.channel].value:.2f}",
        ]
        for one, other in found.differences(part)
    ]


def estimate_rows(estimates: Sequence[Estimate]) -> list[list[str]]:
    """Returns the rows of a table with ESTIMATES."""
    return [
        [
            one.key,
            one.unit,
            number(one.before),
            one.found,
            one.interval,
            "yes" if one.determined else "in part" if one.depends else "no",
        ]
        for one in estimates
    ]


def shown_estimates(estimates: Sequence[Estimate]) -> tuple[list[Estimate], int]:
    """Returns the estimates for a terminal without biases that may be 0, and how many those are."""
    shown = [
        one
        for one in estimates
        if not (one.key.startswith(BIAS) and one.low <= 0.0 <= one.high and one.determined)
    ]
    return shown, len(estimates) - len(shown)


def open_text(found: Identified) -> str:
    """Returns what the logs do not determine, as sentences."""
    if found.rejected:
        return "The logs reject the model, so they determine no number."
    missing = [one.key for one in found.estimates if not one.determined and not one.depends]
    text = (
        f"The logs determine {found.fit.rank} independent combinations of {len(found.fit.rows)} "
        "numbers better than the robot file. "
    )
    text += f"Not determined: {', '.join(missing)}." if missing else "They determine every number."
    for one in found.estimates:
        if one.depends:
            text += (
                f" The value {one.found} of {one.key} holds as long as {', '.join(one.depends)} "
                "have the file's."
            )
    channels = {key for one in found.experiments for key in one.channels}
    if "current" not in channels and any(
        one.key in MOTOR and not one.determined for one in found.estimates
    ):
        text += (
            " Currents would determine both the motor's torque constant and its resistance: "
            "record LF.coxa.current [A], ..."
        )
    if set(GEAR) & set(missing) and "motor_angle" not in channels:
        text += (
            " Elasticity and play of gears show most in the angles of rotors beside those of "
            "links: record LF.coxa.motor_angle [rad], ..."
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
    advice = (
        "find all groups of numbers, look at the curves of these channels, or choose another model "
        "of servo (--friction) or ground."
    )
    if found.rejected:
        texts.append(
            "The logs reject the model: mean squares of residuals over those of the readings' "
            f"noise are {REJECTED:g} and more in {_channels(found.fit.rejected)}. A fit of a wrong "
            f"model has wrong numbers, so all stay as in the robot file: {advice}"
        )
    elif found.fit.unexplained:
        texts.append(
            "The model does not explain this log: mean squares of residuals over those of the "
            f"readings' noise are too large in {_channels(found.fit.unexplained)}. The intervals "
            f"are wider for it, but may miss the true numbers: {advice}"
        )
    return texts


def _channels(sizes: dict[str, float]) -> str:
    return ", ".join(f"{TITLES[key].lower()} ({value:.1f})" for key, value in sizes.items())
