"""Defines the command `hexapod identify`: a robot's numbers from its own logs."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hexapod_cosim.cosim.cli.options import Json, RobotName
from hexapod_cosim.cosim.cli.terminal import (
    show_files,
    show_json,
    show_table,
    show_text,
    step_lines,
    waiting,
    warn,
)
from hexapod_cosim.cosim.results.results import results_folder
from hexapod_cosim.extensions.identify.log import HELD_OUT, read_log
from hexapod_cosim.extensions.identify.numbers.friction_models import CHOICES
from hexapod_cosim.extensions.identify.unknowns import GROUPS
from hexapod_cosim.models import HexapodError, load_robot, unknown_name

if TYPE_CHECKING:
    from hexapod_cosim.extensions.identify.identified import Identified

FOUND = ("servo", "mass", "contact", "sensor")  # without --find
Logs = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG...",
        help="CSV, Parquet or MCAP files with commands and readings, each from standing still on.",
    ),
]
Find = Annotated[
    list[str] | None,
    typer.Option(
        "--find",
        metavar="|".join(GROUPS),
        help="Which numbers to find; repeat it for more. Default: all but zero, the legs' zeros.",
    ),
]
HeldOut = Annotated[
    float,
    typer.Option("--held-out", metavar="SHARE", help="Part of each log that only judges."),
]
Friction = Annotated[
    str | None,
    typer.Option(
        "--friction",
        metavar="|".join(CHOICES),
        help="Friction model of measured servos; best: the one that explains the logs best. "
        "Default: the terms of the robot file.",
    ),
]
Propose = Annotated[
    bool,
    typer.Option("--propose/--no-propose", help="Search for a walk that would tell more."),
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers", metavar="N", min=1, help="Processes; default: one for each processor."
    ),
]
Folder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Where to write; default out/identify."),
]


def identify(
    logs: Logs,
    robot: RobotName = "athena",
    find: Find = None,
    friction: Friction = None,
    held_out: HeldOut = HELD_OUT,
    search: Propose = True,
    workers: Workers = None,
    output: Folder = None,
    json: Json = False,
) -> None:
    """Find a robot's masses, servos, contacts and sensors from its own logs."""
    # imported only here because they are slow to import
    from hexapod_cosim.extensions.identify import identify_tables as tables  # noqa: PLC0415
    from hexapod_cosim.extensions.identify.excitation import propose  # noqa: PLC0415
    from hexapod_cosim.extensions.identify.identify import (  # noqa: PLC0415
        identify as identify_robot,
    )
    from hexapod_cosim.extensions.identify.identify import usual_workers  # noqa: PLC0415
    from hexapod_cosim.extensions.identify.identify_files import (  # noqa: PLC0415
        result_table,
        write_identified,
    )

    groups = _checked(find or list(FOUND), held_out)
    if friction is not None and friction not in CHOICES:
        raise unknown_name("friction model", friction, CHOICES, where="--friction")
    own = load_robot(robot)
    words = ["hexapod", "identify", *map(str, logs), "--robot", robot]
    words += [word for name in find or [] for word in ("--find", name)]
    words += ["--friction", friction] if friction else []
    words += ["--held-out", str(held_out)] if held_out != HELD_OUT else []
    words += [] if search else ["--no-propose"]
    recorded = [read_log(path, torso_com=own.torso.com) for path in logs]
    size = workers or usual_workers(recorded)
    with results_folder(output or Path("out") / "identify") as folder:
        with step_lines(shown=not json) as show:
            found = identify_robot(
                recorded,
                own,
                groups=groups,
                held_out=held_out,
                workers=size,
                friction=friction,
                progress=lambda done: show(done.text, done.step, done.simulations),
            )
        with waiting(None if json else "searching for a walk that would tell more"):
            proposals = propose(found, robot) if search else []
        folder.begin()
        command = shlex.join(words)
        files = write_identified(found, proposals, robot, folder.path, command=command)
    for text in tables.warnings(found):
        warn(text.removesuffix("."))
    if json:
        show_json({**result_table(found, proposals), "files": [str(path) for path in files]})
        return
    _show(found, files)
    if search:
        show_text(tables.proposal_text(proposals))


def _checked(names: Sequence[str], held_out: float) -> list[str]:
    """Returns the groups. Raises HexapodError for an unknown one and a share that is none."""
    for name in names:
        if name not in GROUPS:
            raise unknown_name("group of numbers", name, GROUPS, where="--find")
    if not 0.0 <= held_out <= 0.9:
        raise HexapodError(
            "not a share",
            got=held_out,
            expected="0 to 0.9",
            fix="give --held-out 0.25",
            where="--held-out",
        )
    return list(names)


def _show(found: Identified, files: Sequence[Path]) -> None:
    """Prints the estimates, the errors, what the logs did not tell, and the files."""
    from hexapod_cosim.extensions.identify import identify_tables as tables  # noqa: PLC0415

    errors = tables.error_rows(found.held_out() or found.fitted())
    shown, zero = tables.shown_estimates(found.estimates)
    show_table(tables.ESTIMATES, tables.estimate_rows(shown), right=(2, 3, 4))
    if zero:
        show_text(f"{zero} biases of sensors may be 0; sensors.toml and the report have them.")
    show_table(tables.ERRORS, errors, right=(2, 3, 4))
    if found.trials:
        show_text(tables.friction_text(found.trials))
    show_text(tables.untold_text(found))
    show_files(files)
