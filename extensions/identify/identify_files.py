"""Writes an identification into a folder: robot file, sensors, figures, report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tomlkit

from hexapod_cosim.cosim.common.files import RUN_FILE, write_json, write_text
from hexapod_cosim.extensions.identify.comparison import Difference
from hexapod_cosim.extensions.identify.excitation import Proposal, scenario_text
from hexapod_cosim.extensions.identify.figures import channel_figures, embedded
from hexapod_cosim.extensions.identify.fitting.misfit import EXPLAINED
from hexapod_cosim.extensions.identify.identified import NEAR, Identified
from hexapod_cosim.extensions.identify.identify_tables import (
    BASE,
    ERRORS,
    ESTIMATES,
    MISFIT,
    TRIALS,
    base_rows,
    base_values,
    error_rows,
    estimate_rows,
    friction_text,
    misfit_rows,
    proposal_text,
    trial_rows,
    untold_text,
    warnings,
)
from hexapod_cosim.extensions.identify.page import Section, number, rendered
from hexapod_cosim.extensions.identify.robot_file import SENSORS, sensors_table, write_robot

BASE_KEYS = ("combination", "unit", "before", "least_squares", "deviation", "found")
KIND, ROBOT_FILE, REPORT, RESULT = "identify", "robot.toml", "report.html", "identify.json"
EXPERIMENT = "experiment.toml"


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
        "robot": {"name": found.origin.name, "hash": found.origin.hash},
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
        "rejected": found.fit.rejected,
        "friction_models": [asdict(one) for one in found.trials],
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


def _error_table(pairs: Sequence[tuple[Difference, Difference]]) -> list[dict[str, Any]]:
    return [
        {"channel": one.channel, "unit": one.unit, "before": one.rms, "after": other.rms}
        for one, other in pairs
    ]


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
        *(
            [
                Section(
                    title="Which friction model?",
                    caption=friction_text(found.trials),
                    columns=TRIALS,
                    rows=trial_rows(found),
                    left=1,
                )
            ]
            if found.trials
            else []
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
