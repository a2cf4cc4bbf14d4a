"""Writes a replay into a folder: table, simulated rows, report."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.files import RUN_FILE, write_json, write_text
from hexapod_cosim.cosim.results.recordings import write_recording
from hexapod_cosim.cosim.results.results import RESULTS
from hexapod_cosim.cosim.scenario.records import default_formats
from hexapod_cosim.extensions.identify.figures import channel_figures, embedded
from hexapod_cosim.extensions.identify.page import COLUMNS, Section, difference_rows, rendered
from hexapod_cosim.extensions.identify.replay import Replay
from hexapod_cosim.models import Robot

REPLAY, KIND = "replay.csv", "replay"
REPORT = "report.html"
CAPTION = (
    "Errors are simulated minus measured, over all rows; the spread is the root mean square of the "
    "readings about their mean."
)


def write_replay(
    done: Replay, robot: Robot, folder: Path, *, command: str, settings: Mapping[str, Any]
) -> list[Path]:
    """Writes replay.csv, the simulated rows, the report and run.json; returns the files."""
    channels = [one.as_table() for one in done.channels]
    facts = {
        "kind": KIND,
        "status": "completed",
        "log": done.log.where,
        "robot": {"name": robot.name, "hash": robot.hash},
        "settings": dict(settings),
        "command": command,
        "channels": channels,
        "warnings": done.warnings,
    }
    write_text(folder / REPLAY, _table(done))
    (simulated,) = write_recording(
        done.simulated,
        folder,
        RESULTS,
        formats=default_formats()[:1],
        about={"log": done.log.where},
    )
    write_text(folder / REPORT, _page(done, robot, command, simulated.name))
    write_json(folder / RUN_FILE, facts)
    return [folder / REPLAY, simulated, folder / REPORT, folder / RUN_FILE]


def _table(done: Replay) -> str:
    """Returns the differences of all columns as CSV."""
    text = io.StringIO()
    rows = [one.as_table() for one in done.columns]
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _page(done: Replay, robot: Robot, command: str, simulated_file: str) -> str:
    time, simulated = done.log.time, done.simulated
    columns = {name: simulated.column(name) for name in done.names}
    figures = channel_figures(done.log, {"simulated": columns})
    pictures = {title: embedded(svg) for title, svg in figures.items()}
    sections = [
        Section(
            title="Channel by channel",
            caption=CAPTION,
            columns=COLUMNS,
            rows=difference_rows(done.channels),
            left=2,
        ),
        Section(title="Measured and simulated", pictures=pictures),
        Section(
            title="Column by column",
            columns=COLUMNS,
            rows=difference_rows(done.columns),
            left=2,
        ),
    ]
    return rendered(
        sections,
        title=f"Replay of {Path(done.log.where).name}",
        headline=f"Robot {robot.name}, {time[-1] - time[0]:.2f} s, {len(time)} rows",
        lead="The plant FMU was driven with the commands of the log, from its first row on.",
        warnings=done.warnings,
        command=command,
        facts={"log": done.log.where, "robot": robot.name, "SHA-256 of the robot": robot.hash},
        source=f"{REPLAY} and {simulated_file}",
    )
