"""Defines the command `hexapod compare`."""

from __future__ import annotations

from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.failures import RUN_EPILOG
from hexapod_cosim.cosim.cli.options import (
    CheckAccuracy,
    ControlNames,
    Engine,
    FmuFile,
    FolderName,
    GainsFile,
    Json,
    Name,
    Settings,
)

EPILOG = RUN_EPILOG
Seeds = Annotated[
    int,
    typer.Option(
        "--seeds",
        metavar="N",
        help="Runs of each control, which small variations tell apart; 1: the plain walk alone.",
    ),
]


def compare(
    scenario: Name = "walk_flat",
    control: ControlNames = None,
    seeds: Seeds = 10,
    settings: Settings = None,
    output: FolderName = None,
    fmu: FmuFile = None,
    gains: GainsFile = None,
    accuracy: CheckAccuracy = False,
    engine: Engine = None,
    json: Json = False,
) -> int:
    """Run a walk under several controls, and report each against the first.

    All walk in the gait and stance of the scenario, or else of the robot file; kinematic@chosen
    walks in those that compliant control chooses, and compliant@chosen is compared with it. Without
    --control these are kinematic, paper and compliant. Where the scenario names neither gait nor
    stance, and no gains are given, these two are in the tables too, without recordings.
    """
    from hexapod_cosim.cosim.cli import paired_runs
    from hexapod_cosim.cosim.cli.runs import RunOptions, Words

    words = Words(control, settings or [], engine, fmu, gains, seeds, accuracy)
    options = RunOptions.read(fmu=fmu, gains=gains, engine=engine, runs=seeds)
    return paired_runs.compare(scenario, words, options, output=output, as_json=json)
