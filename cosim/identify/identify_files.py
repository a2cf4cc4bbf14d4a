"""Writes an identification into a folder: robot file, sensors, figures, report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomlkit

from hexapod_cosim.cosim.common.files import RUN_FILE, write_json, write_text
from hexapod_cosim.cosim.identify.comparison import Difference
from hexapod_cosim.cosim.identify.excitation import Proposal, scenario_text
from hexapod_cosim.cosim.identify.figures import channel_figures, embedded
from hexapod_cosim.cosim.identify.fitting.problem import EXPLAINED
from hexapod_cosim.cosim.identify.identify import NEAR, Estimate, Identified
from hexapod_cosim.cosim.identify.page import TITLES, Section, number, rendered
from hexapod_cosim.cosim.identify.rigid.base_parameters import base_of, group_parameters
from hexapod_cosim.cosim.identify.robot_file import SENSORS, sensors_table, write_robot
from hexapod_cosim.cosim.identify.screening import left_out
from hexapod_cosim.cosim.identify.start import moving_at_rest
from hexapod_cosim.cosim.identify.unknowns import BIAS, GEAR

BASE_KEYS = ("combination", "unit", "before", "least_squares", "deviation", "found")
KIND, ROBOT_FILE, REPORT, RESULT = "identify", "robot.toml", "report.html", "identify.json"
EXPERIMENT = "experiment.toml"
ESTIMATES = ("number", "unit", "before", "found", "95 % interval", "told", "nearest partner")
BASE = ("base parameter", "unit", "before", "least squares", "deviation", "found")
MISFIT = ("channel", "noise", "fitted", "held out")
ERRORS = ("channel", "unit", "before", "after", "ratio")


def write_identified(
    found: Identified,
    proposals: Sequence[Proposal],
    file: str,
    folder: Path,
    *,
    command: str,
) -> list[Path]:
    """Writes robot.toml, sensors.toml, identify.json, the proposed experiment, the report and
    run.json; returns the files.

    file: the robot file that was given.
    """
    logs = [one.log.where for one in found.experiments]
    names = [ROBOT_FILE, SENSORS, RESULT]
    write_robot(found, file, folder / ROBOT_FILE, logs)
    write_text(folder / SENSORS, tomlkit.dumps(dict(sensors_table(found))))
    content = result_table(found, proposals)
    write_json(folder / RESULT, content)
    if proposals and proposals[0].tells:
        names.append(EXPERIMENT)
        write_text(folder / EXPERIMENT, scenario_text(proposals[0], ROBOT_FILE))
    write_text(folder / REPORT, _page(found, proposals, command))
    facts = {
        "kind": KIND,
        "status": "completed",
        "logs": logs,
        "robot": {"name": found.file.name, "hash": found.file.hash},
        "command": command,
    }
    write_json(folder / RUN_FILE, facts)
    return [folder / name for name in (*names, REPORT, RUN_FILE)]


def result_table(found: Identified, proposals: Sequence[Proposal]) -> dict[str, Any]:
    """Returns everything that was found, for JSON."""
    return {
        "estimates": [{**asdict(one), "told": one.told} for one in found.estimates],
        "rank": found.rank,
        "unknowns": len(found.fit.rows),
        "noise": dict(found.fit.noise),
        "deviations_from_optimum": found.fit.decrement,
        "readings_that_count_as_one": dict(found.fit.correlated),
        "mean_square_over_noise": {
            "fitted": {key: one.value for key, one in found.fit.misfit.items()},
            "held_out": {key: one.value for key, one in found.fit.held_out.items()},
        },
        "unexplained": found.fit.unexplained,
        "base_parameters": [dict(zip(BASE_KEYS, row, strict=True)) for row in base_values(found)],
        "no_base_parameters": found.lacking,
        "bad_columns": [
            {"log": found.experiments[number].log.where, **asdict(column)}
            for number, column in found.bad
        ],
        "held_out": _error_table(found.held_out()),
        "fitted": _error_table(found.fitted()),
        "proposals": [
            {"walk": one.title, "tells": list(one.tells), "deviations": dict(one.deviations)}
            for one in proposals
        ],
    }


def _finite(value: str | float) -> str | float | None:
    """Returns a value for JSON, which has no infinity."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def base_values(found: Identified) -> list[tuple[str, str, float, float, float, float]]:
    """Returns name, unit, the robot file's value, that of linear least squares, its deviation and
    the identified robot's value of each base parameter.
    """
    if found.linear is None:
        return []
    one = found.linear.base
    own = base_of(found.file).values(group_parameters(found.robot))
    return [
        (name, unit, float(before), float(value), float(deviation), float(after))
        for name, unit, before, value, deviation, after in zip(
            one.names, one.units, one.before, one.values, one.deviations, own, strict=True
        )
    ]


def base_rows(found: Identified) -> list[list[str]]:
    """Returns the rows of a table with BASE, of base parameters that the logs tell well.

    Their deviation is below a tenth of the largest value of their unit.
    """
    values = base_values(found)
    largest = {unit: max(abs(row[2]) for row in values if row[1] == unit) for _, unit, *_ in values}
    return [
        [name, unit, number(before), number(value), f"{deviation:.2g}", number(after)]
        for name, unit, before, value, deviation, after in values
        if deviation < 0.1 * largest[unit]
    ]


def misfit_rows(found: Identified) -> list[list[str]]:
    """Returns the rows of a table with MISFIT."""
    return [
        [
            TITLES[key],
            number(found.fit.noise[key]),
            f"{one.value:.2f}",
            f"{found.fit.held_out[key].value:.2f}" if key in found.fit.held_out else "",
        ]
        for key, one in found.fit.misfit.items()
    ]


def warnings(found: Identified) -> list[str]:
    """Returns what a user must know of the result, as sentences."""
    texts = [
        text
        for one in found.experiments
        for text in left_out([column for number, column in found.bad if number == one.number])
    ]
    for one in found.experiments:
        moving = moving_at_rest(one.log)
        if moving:
            texts.append(
                f"The robot still moves at the start of {one.log.where}, where its commands stand "
                f"still ({moving}). The simulation begins with the mean of these rows, at rest: "
                "let the robot stand longer before the recording, or cut the first rows off."
            )
    if _has_motor_angles(found) and found.file.servo.gear_stiffness == 0.0:
        texts.append(
            "The log has the angles of rotors, but the gears of the robot file are rigid: their "
            "stiffness and play are not sought. Give a first servo.gear_stiffness, of about ten "
            "times kp."
        )
    if found.fit.decrement > 1.0:
        texts.append(
            f"The search ended {found.fit.decrement:.1f} deviations before the optimum of the "
            "linearised problem. The intervals contain this step, but are a guess: give a longer "
            "log, or begin again from the robot file that was written."
        )
    worst = found.fit.unexplained
    if worst:
        named = ", ".join(f"{TITLES[key].lower()} ({value:.1f})" for key, value in worst.items())
        texts.append(
            "The model does not explain this log: mean squares of residuals over those of the "
            f"readings' noise are too large in {named}. The intervals are wider for it, but may "
            "miss the true numbers: find all groups of numbers, look at the curves of these "
            "channels, or choose another model of servo or ground."
        )
    return texts


def _error_table(pairs: Sequence[tuple[Difference, Difference]]) -> list[dict[str, Any]]:
    return [
        {"channel": one.channel, "unit": one.unit, "before": one.rms, "after": other.rms}
        for one, other in pairs
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
            "yes" if one.told else "no",
            f"{one.partner} {one.correlation:+.2f}" if abs(one.correlation) > NEAR else "",
        ]
        for one in estimates
    ]


def shown_estimates(estimates: Sequence[Estimate]) -> tuple[list[Estimate], int]:
    """Returns the estimates for a terminal without biases that may be 0, and how many those are."""
    shown = [
        one
        for one in estimates
        if not (one.key.startswith(BIAS) and one.low <= 0.0 <= one.high and one.told)
    ]
    return shown, len(estimates) - len(shown)


def error_rows(pairs: Sequence[tuple[Difference, Difference]]) -> list[list[str]]:
    """Returns the rows of a table with ERRORS."""
    return [
        [
            TITLES[one.channel],
            one.unit,
            number(one.rms),
            number(other.rms),
            f"{one.rms / other.rms:.1f}" if other.rms > 0.0 else "",
        ]
        for one, other in pairs
    ]


def untold_text(found: Identified) -> str:
    """Returns what the logs cannot tell, as a sentence."""
    untold = [one.key for one in found.estimates if not one.told]
    text = (
        f"The logs tell {found.rank} independent combinations of {len(found.fit.rows)} numbers "
        "better than the robot file. "
    )
    if not untold:
        return text + "They tell every number."
    text += f"They do not tell: {', '.join(untold)}."
    if set(GEAR) & set(untold) and not _has_motor_angles(found):
        text += (
            " Elasticity and play of gears show most in the angles of rotors beside those of "
            "links: record LF.coxa.motor_angle [rad], ..."
        )
    return text


def _has_motor_angles(found: Identified) -> bool:
    return any("motor_angle" in one.channels for one in found.experiments)


def proposal_text(proposals: Sequence[Proposal]) -> str:
    """Returns which experiment would tell more, as a sentence."""
    if not proposals:
        return "No walk was tried."
    if not proposals[0].tells:
        return "None of the walks that were tried would tell more."
    best = proposals[0]
    return f"{best.title} would tell: {', '.join(best.tells)}."


def _page(found: Identified, proposals: Sequence[Proposal], command: str) -> str:
    estimates, held = found.estimates, found.held_out()
    told = [one for one in estimates if one.told]
    first = found.experiments[0]
    sides = {"before": found.before[0], "after": found.fit.predictions[0]}
    simulations = {
        label: dict(zip(first.columns, own.T, strict=True)) for label, own in sides.items()
    }
    split = float(first.log.time[first.held_out][0]) if _rows(first.held_out) else None
    figures = channel_figures(first.log, simulations, split=split)
    sections = [
        Section(
            title="Held-out rows",
            caption="Root mean squares of simulated minus measured over the rows that the fit did "
            "not see, before and after; they contain the noise of the sensors.",
            columns=ERRORS,
            rows=error_rows(held),
            left=2,
        ),
        Section(
            title="Numbers",
            caption="Told: the logs at least halve what was unknown of a number. The partner is "
            f"the number with which it is correlated, above {NEAR}.",
            columns=ESTIMATES,
            rows=estimate_rows(estimates),
            left=2,
        ),
        Section(
            title="Does the model explain the log?",
            caption="Mean squares of residuals over those of the readings' own noise, which their "
            "second differences show: 1 where the model explains the readings, more where it has "
            f"errors. Above {EXPLAINED:g} (more where readings are few) the page warns; fitted "
            "rows above 1 widen all intervals.",
            columns=MISFIT,
            rows=misfit_rows(found),
            left=1,
        ),
        Section(
            title="Base parameters",
            caption=_base_caption(found),
            columns=BASE,
            rows=base_rows(found),
            left=2,
        ),
        Section(title="What the logs cannot tell", caption=untold_text(found)),
        Section(
            title="Which experiment would",
            caption=proposal_text(proposals),
            columns=("walk", "tells besides", "median deviation"),
            rows=[
                [one.title, ", ".join(one.tells) or "nothing", number(one.median)]
                for one in proposals
            ],
            left=2,
        ),
        Section(
            title="Measured and simulated",
            caption="The rows right of the vertical line were held out.",
            pictures={title: embedded(svg) for title, svg in figures.items()},
        ),
    ]
    return rendered(
        sections,
        title=f"Robot {found.file.name} identified from {_count(len(found.experiments), 'log')}",
        headline=f"{len(told)} of {len(estimates)} numbers are told by the logs",
        lead="Each number is the most probable one, given the readings and the robot file.",
        warnings=warnings(found),
        command=command,
        facts={
            "logs": ", ".join(one.log.where for one in found.experiments),
            "rows": ", ".join(str(len(one.log.time)) for one in found.experiments),
            "noise": ", ".join(f"{key} {value:.3g}" for key, value in found.fit.noise.items()),
        },
        source=RESULT,
    )


def _count(number: int, name: str) -> str:
    """Returns a number of things in words."""
    return f"a {name}" if number == 1 else f"{number} {name}s"


def _base_caption(found: Identified) -> str:
    """Returns what base parameters are and where these come from."""
    text = (
        "Combinations of masses m, first moments mx and inertias J about the links' joints that "
        "the equations of motion hold; no log tells their parts apart. "
    )
    if found.linear is None:
        return text + f"They need readings that the logs lack: {found.lacking}."
    return text + (
        "Linear least squares found them without a simulation, as a start of the fit; shown are "
        "those that the logs tell well."
    )


def _rows(part: slice) -> int:
    return int(part.stop - part.start)
