"""Defines the command `hexapod compare`."""

from __future__ import annotations

from typing import Annotated

import typer

from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.failures import FELL
from hexapod_cosim.cosim.cli.options import (
    CheckAccuracy,
    ControlNames,
    Engine,
    FmuFile,
    FolderName,
    GainsFile,
    Json,
    Settings,
)

EPILOG = (
    f"Exit code {FELL} when the robot did not walk to the end of every run, under any control: "
    "the report is written all the same, says how many did, "
    "and compares the seeds on which both walked."
)
Names = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="SCENARIO...",
        help="Scenario files, or names of `hexapod list scenarios`; several: a table over them. "
        "Default walk_flat.",
        show_default=False,
        autocompletion=completion.scenario,
    ),
]
Seeds = Annotated[
    int,
    typer.Option(
        "--seeds",
        metavar="N",
        help="Runs of each control, which small variations tell apart; 1: the plain walk alone.",
    ),
]


def compare(
    scenarios: Names = None,
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
    """Run one or several walks under several controls, and report each against the first.

    All walk in the gait and stance of the scenario, or else of the robot file; kinematic@chosen
    walks in those that compliant control chooses, and compliant@chosen is compared with it. Without
    --control these are kinematic, paper and compliant. Where one scenario is given that names
    neither gait nor stance, and no gains, these two are in the tables too, without recordings.
    """
    from hexapod_cosim.cosim.cli.comparing import compare_each
    from hexapod_cosim.cosim.cli.running import RunOptions, Words

    words = Words(control, settings or [], engine, fmu, gains, seeds, accuracy)
    options = RunOptions.read(fmu=fmu, gains=gains, engine=engine, runs=seeds)
    return compare_each(scenarios or ["walk_flat"], words, options, output=output, as_json=json)
