"""Defines the command `hexapod study`, which runs a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.failures import FELL
from hexapod_cosim.cosim.cli.options import ControlNames, FmuFile, GainsFile, Json
from hexapod_cosim.cosim.common.installation import require_pyarrow

EPILOG = (
    f"A fall is a result of a study. Exit code {FELL} only when no run walked to its end "
    "and the robot fell in some of them."
)


def study(
    file: Annotated[
        str,
        typer.Argument(metavar="STUDY", help="A study file, or a name of `hexapod list studies`."),
    ],
    control: ControlNames = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="DIR", help="Folder to write or resume; default out/STUDY."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=4096,
            metavar="N",
            help="Processes; default: one for each processor; 0: none.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Run on this Dask scheduler: tcp://HOST:8786."),
    ] = None,
    fmu: FmuFile = None,
    gains: GainsFile = None,
    json: Json = False,
) -> int:
    """Run a study: a sweep, a Monte Carlo study or an optimisation.

    --control replaces the controls of the file. A study that was stopped resumes when the same
    command is started again.
    """
    require_pyarrow("studies", "hexapod study")
    # imported here: both are slow, and help needs neither
    from hexapod_cosim.cosim.cli.runs import Words, given_gains  # noqa: PLC0415
    from hexapod_cosim.extensions.study.run import Options, run_and_report  # noqa: PLC0415

    options = Options(
        fmu=fmu,
        gains=given_gains(gains),
        workers=workers,
        scheduler=scheduler,
        command=Words(control, [], fmu=fmu, gains=gains).command("study", file),
    )
    folder = output or Path("out") / Path(file).stem
    return run_and_report(file, folder, options, controls=control or [], json=json)


def report_again(folder: Path) -> Sequence[Path]:
    """Writes the tables and the report of a study's folder again; returns the files."""
    require_pyarrow("studies", "hexapod report")
    from hexapod_cosim.extensions.study.run import report_on  # noqa: PLC0415  slow

    return report_on(folder)[1]
