"""Options that several commands share. It imports nothing slow, since completion loads it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli import completion

ENGINES = ("compiled", "python")

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]
Name = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="A scenario file, or a name of `hexapod list scenarios`.",
        autocompletion=completion.scenario,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Set a key of the scenario (gait.period=0.8) or an FMU parameter.",
        autocompletion=completion.setting,
    ),
]
FolderName = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/SCENARIO."),
]
RobotName = Annotated[
    str,
    typer.Option(
        "--robot",
        metavar="FILE",
        help="A robot file, a URDF, or a name of `hexapod list robots`.",
        autocompletion=completion.robot,
    ),
]


def _tried_fmu(context: typer.Context, path: Path | None) -> Path | None:
    """Returns the path of an FMU that does not end the process which loads it.

    The completion of a command line does not try it.
    """
    if path is not None and not context.resilient_parsing:
        from hexapod_cosim.cosim.control.fmu_instance import refuse_crashing

        refuse_crashing(path)
    return path


FmuFile = Annotated[
    Path | None,
    typer.Option(
        "--fmu",
        metavar="FILE",
        help="Use this FMU instead of exporting the robot's own.",
        callback=_tried_fmu,
    ),
]
GainsFile = Annotated[
    Path | None,
    typer.Option(
        "--gains", metavar="FILE", help="Gains from `hexapod design` instead of designing them now."
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers", min=1, metavar="N", help="Processes; default: one for each processor."
    ),
]
Engine = Annotated[
    str | None,
    typer.Option(
        "--engine",
        metavar="|".join(ENGINES),
        help="Controller and loop; by default python for one run, compiled for many. What the loop "
        "in C cannot run (a controller in Python, an FMU of FMI 3.0) runs on the loop in Python.",
    ),
]
ControlNames = Annotated[
    list[str] | None,
    typer.Option(
        "--control",
        metavar="CONTROL",
        help="kinematic, paper, compliant, law.py:Class or controller.fmu; LABEL=CONTROL names it, "
        "CONTROL@chosen walks in the gait and stance that compliant control chooses. "
        "Repeat it for more.",
        show_default=False,
        autocompletion=completion.control,
    ),
]
CheckAccuracy = Annotated[
    bool,
    typer.Option(
        "--check-accuracy",
        help="Walk again at a hundredth of the solver's tolerance: an error beside every metric.",
    ),
]


def command_line(name: str, *words: object, **options: object) -> str:
    """Returns the command `name` with words and options; those that are None or False are left out.

    A list is an option for each of its items.
    """
    written = ["hexapod", name, *map(str, words)]
    for key, value in options.items():
        for item in value if isinstance(value, list) else [value]:
            flag = f"--{key.replace('_', '-')}"
            written += [] if item is None or item is False else [flag]
            written += [] if item is None or isinstance(item, bool) else [str(item)]
    return shlex.join(written)
