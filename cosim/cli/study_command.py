"""`hexapod study`: many runs."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.failures import FELL
from hexapod_cosim.cosim.cli.running import FmuFile, GainsFile, given_gains
from hexapod_cosim.cosim.cli.terminal import Json, warn
from hexapod_cosim.cosim.study.execute.engines import DEFAULT_ENGINE, ENGINES
from hexapod_cosim.cosim.study.plan.records import StudyError

EPILOG = f"A fall is a result of a study. Exit code {FELL} only when the robot walked to the end of no run at all and fell in some."
MAX_WORKERS = 4096
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers",
        metavar="N",
        help="Processes on this machine; default: one for each processor; 0: this one.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Run on the workers of this Dask scheduler: tcp://HOST:8786.",
    ),
]
StudyFolder = Annotated[
    Path | None,
    typer.Option(
        "-o", "--output", metavar="DIR", help="Where to write, or to go on; default out/STUDY."
    ),
]
EngineName = Annotated[
    str,
    typer.Option(
        "--engine",
        metavar="|".join(ENGINES),
        help="How figures are made; or MODULE:NAME of your own.",
    ),
]


def study(
    file: Annotated[
        str,
        typer.Argument(metavar="STUDY", help="A study file, or a name of `hexapod list studies`."),
    ],
    output: StudyFolder = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    engine: EngineName = DEFAULT_ENGINE,
    fmu: FmuFile = None,
    gains: GainsFile = None,
    json: Json = False,
) -> int:
    """Run a study: sweeps, Monte Carlo, tuning. Stopped at any point and started again, it goes
    on where it was.
    """
    # slow to import, and no other command needs it
    from hexapod_cosim.cosim.cli.studying import carry_out  # noqa: PLC0415
    from hexapod_cosim.cosim.study.execute.study import Options  # noqa: PLC0415

    options = Options(
        engine=engine,
        fmu=fmu,
        gains=given_gains(gains),
        workers=_checked_workers(workers),
        scheduler=scheduler,
        say=warn,
        command=_command_line(
            file,
            {"engine": engine if engine != DEFAULT_ENGINE else None, "fmu": fmu, "gains": gains},
        ),
    )
    return carry_out(file, output or Path("out") / Path(file).stem, options, json=json)


def _checked_workers(count: int | None) -> int | None:
    if count is not None and not 0 <= count <= MAX_WORKERS:
        raise StudyError(
            "not a number of workers",
            got=count,
            expected=f"0 to {MAX_WORKERS}",
            fix="write --workers 2",
            where="--workers",
        )
    return count


def _command_line(file: str, options: Mapping[str, object]) -> str:
    words = [
        word
        for name, value in options.items()
        if value is not None
        for word in (f"--{name}", str(value))
    ]
    return shlex.join(["hexapod", "study", file, *words])
