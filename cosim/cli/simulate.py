"""Defines the command `hexapod simulate`."""

from __future__ import annotations

from pathlib import Path
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
Formats = Annotated[
    list[str] | None,
    typer.Option(
        "--format",
        metavar="parquet|csv|mcap",
        help="Write the recording as this, instead of outputs.formats. Repeat it for more.",
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
    from hexapod_cosim.cosim.cli.runs import RunOptions, Words
    from hexapod_cosim.cosim.cli.scenario_runs import simulate_each
    from hexapod_cosim.cosim.common.temporary import TemporaryFolder
    from hexapod_cosim.cosim.scenario.records import FORMATS
    from hexapod_cosim.models import unknown_name

    for name in formats or []:
        if name not in FORMATS:
            raise unknown_name("format", name, FORMATS, where="--format")
    given = [*(settings or []), *([f"outputs.formats={formats!r}"] if formats else [])]
    words = Words(control, given, engine=engine, fmu=fmu, gains=gains, accuracy=accuracy)
    with TemporaryFolder("package") as folder:
        package = None
        if scenario.endswith(".ssp"):
            package = read_package(Path(scenario), folder, given)
        plant = fmu if fmu or package is None else package.plant
        options = RunOptions.read(fmu=plant, gains=gains, engine=engine, runs=1)
        return simulate_each(scenario, words, options, output=output, as_json=json, package=package)
