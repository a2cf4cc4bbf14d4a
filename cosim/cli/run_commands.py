"""Defines the commands `hexapod simulate` and `hexapod compare`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.failures import FELL
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

EPILOG = (
    f"Exit code {FELL} when the robot fell, or did not walk to the end of every run of a "
    "comparison: what was recorded and measured is written all the same, and a comparison is of "
    "the seeds on which both walked."
)
Formats = Annotated[
    list[str] | None,
    typer.Option(
        "--format",
        metavar="parquet|csv|mcap",
        help="Write the recording as this, instead of outputs.formats. Repeat it for more.",
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


def simulate(
    scenario: Name = "walk_flat",
    control: ControlNames = None,
    settings: Settings = None,
    formats: Formats = None,
    output: FolderName = None,
    fmu: FmuFile = None,
    gains: GainsFile = None,
    accuracy: CheckAccuracy = False,
    engine: Engine = None,
    json: Json = False,
) -> int:
    """Run one co-simulation: results, metrics, plots. Several controls: a run of each. SCENARIO may
    be a package (.ssp) of a plant and a controller.
    """
    from hexapod_cosim.cosim.cli.package import read_package
    from hexapod_cosim.cosim.cli.running import RunOptions, Words
    from hexapod_cosim.cosim.cli.simulating import simulate_each
    from hexapod_cosim.cosim.common.temporary import TemporaryFolder

    given = [*(settings or []), *([f"outputs.formats={formats!r}"] if formats else [])]
    words = Words(control, given, engine=engine, fmu=fmu, gains=gains, accuracy=accuracy)
    with TemporaryFolder("package") as folder:
        package = None
        if scenario.endswith(".ssp"):
            package = read_package(Path(scenario), folder, given)
        plant = fmu if fmu or package is None else package.plant
        options = RunOptions.read(fmu=plant, gains=gains, engine=engine, runs=1)
        return simulate_each(scenario, words, options, output=output, as_json=json, package=package)


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
    from hexapod_cosim.cosim.cli import comparing
    from hexapod_cosim.cosim.cli.running import RunOptions, Words

    words = Words(control, settings or [], engine, fmu, gains, seeds, accuracy)
    options = RunOptions.read(fmu=fmu, gains=gains, engine=engine, runs=seeds)
    return comparing.compare(scenario, words, options, output=output, as_json=json)
