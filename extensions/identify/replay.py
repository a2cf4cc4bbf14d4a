"""Replays a log: drives the FMU with its commands and compares all readings. Defines the command
`hexapod replay`.
"""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from hexapod_cosim.cosim.cli.options import FmuFile, Json, RobotName, command_line
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_table, waiting, warn
from hexapod_cosim.cosim.common.files import RUN_FILE, write_json, write_text
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.report.page import render
from hexapod_cosim.cosim.results.folder import RESULTS, results_folder
from hexapod_cosim.cosim.results.recordings import write_recording
from hexapod_cosim.cosim.scenario.records import default_formats
from hexapod_cosim.extensions.identify.bench import is_bench_log
from hexapod_cosim.extensions.identify.experiment import Experiment
from hexapod_cosim.extensions.identify.log import (
    Log,
    read_log,
    with_speed_references,
    without_readings,
)
from hexapod_cosim.extensions.identify.plant import LogPlant
from hexapod_cosim.extensions.identify.report import (
    COLUMNS,
    Difference,
    channel_differences,
    channel_figures,
    column_differences,
)
from hexapod_cosim.extensions.identify.screening import BadColumn, left_out, screened
from hexapod_cosim.extensions.identify.start import initial_state
from hexapod_cosim.models import HexapodError, Robot, load_robot

REPLAY, REPORT, KIND = "replay.csv", "report.html", "replay"
TEMPLATE = "log.html.jinja"
LEAD = (
    "The plant was driven with the commands of the log, from its first row on. Errors are "
    "simulated minus measured; the spread is the root mean square of the readings about their mean."
)


@dataclass(frozen=True)
class Replay:
    """A log and the simulation of it."""

    log: Log
    simulated: Recording  # time, commands and the outputs of the log's columns
    names: tuple[str, ...]  # the columns that are compared
    columns: tuple[Difference, ...]
    readings: tuple[BadColumn, ...]  # dead or wrong

    @property
    def warnings(self) -> list[str]:
        """What a user must know of the columns, as sentences."""
        return [*self.log.warnings, *left_out(self.readings, *2 * ("cannot be the robot's",))]

    @property
    def channels(self) -> list[Difference]:
        """The difference of each channel."""
        return channel_differences(self.columns)


def replay(log: Log, robot: Robot, *, fmu: Path | None = None) -> Replay:
    """Simulates a robot from the log's first row on, with the log's commands.

    Args:
        log: commands and the readings to compare.
        robot: the robot that is simulated.
        fmu: its FMU; by default it is exported.

    Raises HexapodError for a log without readings and where the plant cannot follow the commands.
    """
    log = with_speed_references(log, robot)
    with TemporaryFolder("replay") as folder:
        path = fmu or export_fmu(robot, folder / "robot.fmu", bare=True)
        with LogPlant(path) as plant:
            names = plant.known(log.measured)
            if not names:
                raise without_readings(log)
            found = plant.simulate(log, names, initial_state(log, robot))
    inputs = log.commands
    data = np.column_stack([log.time, *inputs.values(), found])
    rows = slice(0, len(log.time))
    whole = Experiment(log=log, number=0, columns=tuple(names), fitted=rows, held_out=slice(0, 0))
    return Replay(
        log=log,
        simulated=Recording(("time", *inputs, *names), data),
        names=tuple(names),
        columns=tuple(column_differences(log, names, found)),
        readings=tuple(screened(whole, found)),
    )


def write_replay(done: Replay, robot: Robot, folder: Path, *, command: str) -> list[Path]:
    """Writes replay.csv, the simulated rows, the report and run.json; returns the files."""
    facts = {
        "kind": KIND, "status": "completed", "log": done.log.where, "command": command,
        "robot": {"name": robot.name, "hash": robot.hash},
        "channels": [asdict(one) for one in done.channels], "warnings": done.warnings,
    }  # fmt: skip
    text = io.StringIO()
    writer = csv.DictWriter(text, [one.name for one in fields(Difference)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(one) for one in done.columns)
    write_text(folder / REPLAY, text.getvalue())
    about, formats = {"log": done.log.where}, default_formats()[:1]
    (simulated,) = write_recording(done.simulated, folder, RESULTS, formats=formats, about=about)
    write_text(folder / REPORT, _page(done, robot, command, simulated.name))
    write_json(folder / RUN_FILE, facts)
    return [folder / REPLAY, simulated, folder / REPORT, folder / RUN_FILE]


def _page(done: Replay, robot: Robot, command: str, simulated_file: str) -> str:
    time = done.log.time
    columns = {name: done.simulated.column(name) for name in done.names}
    return render(
        TEMPLATE,
        package=__package__,
        title=f"Replay of {Path(done.log.where).name}",
        headline=f"Robot {robot.name}, {time[-1] - time[0]:.2f} s, {len(time)} rows",
        lead=LEAD,
        warnings=done.warnings,
        columns=COLUMNS,
        tables={
            "Channel by channel": [one.as_row() for one in done.channels],
            "Column by column": [one.as_row() for one in done.columns],
        },
        pictures=channel_figures(done.log, columns),
        command=command,
        facts={"log": done.log.where, "robot": robot.name, "SHA-256 of the robot": robot.hash},
        source=f"{REPLAY} and {simulated_file}",
    )


LogFile = Annotated[
    Path,
    typer.Argument(
        metavar="LOG",
        help="A CSV, Parquet or MCAP file with commands and readings, or a servo bench's JSON.",
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/replay."),
]


def replay_command(
    log: LogFile,
    robot: RobotName = "athena",
    fmu: FmuFile = None,
    output: Folder = None,
    json: Json = False,
) -> None:
    """Drive the plant FMU with a recorded log and compare all readings with it."""
    own = load_robot(robot)
    if is_bench_log(log):
        if fmu:
            what = "an option that does nothing for the log of a servo bench"
            raise HexapodError(what, got="--fmu", expected="none of it", fix="leave it out")
        _replay_bench(log, own, output, command_line("replay", log, robot=robot), json)
        return
    command = command_line("replay", log, robot=robot, fmu=fmu)
    recorded = read_log(log, robot=own)
    with results_folder(output or Path("out") / "replay", own=("replay.csv",)) as folder:
        with waiting("replaying the log"):
            done = replay(recorded, own, fmu=fmu)
        folder.begin()
        files = write_replay(done, own, folder.path, command=command)
    for text in done.warnings:
        warn(text.removesuffix("."))
    if json:
        channels = [asdict(one) for one in done.channels]
        written = [str(path) for path in files]
        show_json({"channels": channels, "warnings": done.warnings, "files": written})
        return
    show_table(COLUMNS, [one.as_row() for one in done.channels], right=(2, 3, 4, 5))
    show_files(files)


def _replay_bench(log: Path, robot: Robot, output: Path | None, command: str, json: bool) -> None:
    from hexapod_cosim.extensions.identify.bench import command as bench  # noqa: PLC0415

    with results_folder(output or Path("out") / "replay") as folder:
        with waiting("replaying the log"):
            done = bench.replayed(log, robot)
        folder.begin()
        files = bench.write_replay(done, folder.path, command=command)
    for text in done.warnings:
        warn(text.removesuffix("."))
    if json:
        show_json({"errors": asdict(done.errors), "files": [str(path) for path in files]})
        return
    show_table(bench.ERRORS, [bench.error_texts(done.errors)], right=(0, 1, 2, 3))
    show_files(files)
