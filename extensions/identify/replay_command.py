"""Defines the command `hexapod replay`: a recorded log drives the FMU and is compared with it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from hexapod_cosim.cosim.cli.options import FmuFile, Json, RobotName
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_table, waiting, warn
from hexapod_cosim.cosim.results.folder import results_folder
from hexapod_cosim.cosim.scenario.tables import with_overrides
from hexapod_cosim.extensions.identify.log import read_log
from hexapod_cosim.extensions.identify.replay import replay as replay_log
from hexapod_cosim.extensions.identify.replay import write_replay
from hexapod_cosim.extensions.identify.report import COLUMNS
from hexapod_cosim.models import load_robot

LogFile = Annotated[
    Path,
    typer.Argument(metavar="LOG", help="A CSV, Parquet or MCAP file with commands and readings."),
]
Parameters = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="Set a parameter of the FMU (friction.mu=0.5)."
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/replay."),
]


def replay(
    log: LogFile,
    robot: RobotName = "athena",
    settings: Parameters = None,
    fmu: FmuFile = None,
    output: Folder = None,
    json: Json = False,
) -> None:
    """Drive the plant FMU with a recorded log and compare all readings with it."""
    own = load_robot(robot)
    parameters = fmu_parameters(settings or [])
    words = ["hexapod", "replay", str(log), "--robot", robot]
    words += [word for text in settings or [] for word in ("--set", text)]
    words += ["--fmu", str(fmu)] if fmu else []
    recorded = read_log(log, torso_com=own.torso.com)
    with results_folder(output or Path("out") / "replay") as folder:
        with waiting("replaying the log"):
            done = replay_log(recorded, own, fmu=fmu, parameters=parameters)
        folder.begin()
        files = write_replay(done, own, folder.path, command=shlex.join(words), settings=parameters)
    for text in done.warnings:
        warn(text.removesuffix("."))
    if json:
        channels = [asdict(one) for one in done.channels]
        written = [str(path) for path in files]
        show_json({"channels": channels, "warnings": done.warnings, "files": written})
        return
    show_table(COLUMNS, [one.as_row() for one in done.channels], right=(2, 3, 4, 5))
    show_files(files)


def fmu_parameters(settings: Sequence[str]) -> dict[str, Any]:
    """Returns the parameters of the FMU that --set gives, by name. Raises ScenarioError."""
    found: dict[str, Any] = {}

    def flatten(table: Mapping[str, Any], stem: str) -> None:
        for key, value in table.items():
            if isinstance(value, dict):
                flatten(value, f"{stem}{key}.")
            else:
                found[f"{stem}{key}"] = value

    tables = with_overrides({}, settings)
    flatten(tables.pop("parameters", {}), "")
    flatten(tables, "")
    return found
