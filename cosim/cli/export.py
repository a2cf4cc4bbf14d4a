"""Defines `hexapod export`, which writes FMUs and packages, and `hexapod validate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.controller import DEFAULT_PERIOD
from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.options import GainsFile, Json, RobotName

OutputFile = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="FILE",
        help="The file to write; default ROBOT.fmu, .ssp, .urdf or .xml.",
    ),
]
FmiVersion = Annotated[int, typer.Option("--fmi", help="Version of the standard: 2 or 3.")]
Platforms = Annotated[
    str | None,
    typer.Option(
        "--platforms",
        help="Cross-compile for these, separated by commas (linux64, win64, darwin64, "
        "aarch64-linux, or FMI 3's names of them) or all; sources: no binary. "
        "Default: this machine's installed one.",
    ),
]
Urdf = Annotated[
    bool, typer.Option("--urdf", help="Write the robot as a URDF instead; so does -o FILE.urdf.")
]
Mjcf = Annotated[
    bool, typer.Option("--mjcf", help="Write it as a MuJoCo model instead; so does -o FILE.xml.")
]
Ssp = Annotated[
    bool,
    typer.Option(
        "--ssp",
        help="Write plant and controller, connected and walking, as a package (SSP); so does "
        "-o FILE.ssp.",
    ),
]
Values = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Of the package: controller.command.vx=0.05, plant.friction.mu=0.5, ...",
    ),
]
Terrains = Annotated[
    list[str] | None,
    typer.Option(
        "--terrain",
        metavar="NAME[:KEY=VALUE,...]",
        help="Pack a surface of `hexapod list terrains` into the plant's FMU; repeat it for "
        "several, between which the parameter terrain.grid chooses.",
        autocompletion=completion.surface,
    ),
]
ControllerName = Annotated[
    str | None,
    typer.Option(
        "--controller",
        metavar="kinematic|paper|compliant",
        help="Pack the robot's controller instead of the plant.",
        autocompletion=completion.control,
    ),
]
GaitName = Annotated[
    str | None, typer.Option("--gait", help="Of the controller: one of `hexapod list gaits`.")
]
StanceName = Annotated[
    str,
    typer.Option(
        "--stance",
        metavar="own|chosen",
        help="own: stance and gait of the robot file. chosen: those in which compliant control "
        "walks; export plant and controller in the same.",
    ),
]
Period = Annotated[float, typer.Option("--period", help="Of the controller [s].")]


def export(
    context: typer.Context,
    output: OutputFile = None,
    robot: RobotName = "athena",
    fmi: FmiVersion = 2,
    platforms: Platforms = None,
    urdf: Urdf = False,
    mjcf: Mjcf = False,
    ssp: Ssp = False,
    values: Values = None,
    terrain: Terrains = None,
    controller: ControllerName = None,
    gait: GaitName = None,
    stance: StanceName = "own",
    gains: GainsFile = None,
    period: Period = DEFAULT_PERIOD,
    json: Json = False,
) -> None:
    """Pack the plant FMU of a robot, or its controller's, or both as a package, or write the
    robot for other tools.
    """
    from hexapod_cosim.cosim.cli.exported_files import Request, write_export

    request = Request(
        context=context,
        output=output,
        robot=robot,
        fmi=fmi,
        platforms=None if platforms is None else [name.strip() for name in platforms.split(",")],
        urdf=urdf,
        mjcf=mjcf,
        ssp=ssp,
        values=values or [],
        terrains=terrain or [],
        controller=controller,
        gait=gait,
        stance=stance,
        gains=gains,
        period=period,
    )
    write_export(request, as_json=json)


def validate(
    fmu: Annotated[Path, typer.Argument(metavar="FILE.fmu", help="The FMU to check.")],
    json: Json = False,
) -> None:
    """Check an FMU of ours and say what is wrong."""
    from hexapod_cosim.cosim.cli.terminal import show_json
    from hexapod_cosim.cosim.export.validation import UnsoundFmuError, find_problems

    problems = find_problems(fmu)
    if problems:
        if not json:
            print("\n".join(problems))
        raise UnsoundFmuError(fmu, problems)
    if json:
        show_json({"fmu": str(fmu), "valid": True, "problems": []})
    else:
        print(f"{fmu}: no problems found")
