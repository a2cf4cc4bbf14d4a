"""Defines the command `hexapod simulate`."""

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
    f"Exit code {FELL} when the robot fell: what was recorded and measured is written all the same."
)
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
    from hexapod_cosim.cosim.cli.running import RunOptions, Words
    from hexapod_cosim.cosim.cli.simulating import simulate_each

    if scenario.endswith(".ssp"):
        from hexapod_cosim.cosim.cli.packages import read_package
        from hexapod_cosim.cosim.common.temporary import TemporaryFolder

        with TemporaryFolder("package") as folder:
            package = read_package(Path(scenario), folder)
            settings = [*package.settings, *(settings or [])]
            return simulate(
                "walk_flat", control or [str(package.controller)], settings, formats,
                output or Path("out") / Path(scenario).stem, package.plant, gains, accuracy,
                engine, json,
            )  # fmt: skip
    given = [*(settings or []), *([f"outputs.formats={formats!r}"] if formats else [])]
    words = Words(control, given, engine=engine, fmu=fmu, gains=gains, accuracy=accuracy)
    options = RunOptions.read(fmu=fmu, gains=gains, engine=engine, runs=1)
    return simulate_each(scenario, words, options, output=output, as_json=json)
