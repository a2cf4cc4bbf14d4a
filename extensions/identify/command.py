"""Defines the command `hexapod identify`: a robot's numbers from its own logs."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.options import Json, RobotName, Workers, command_line
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_table, show_text, warn
from hexapod_cosim.cosim.results.folder import results_folder
from hexapod_cosim.extensions.identify.bench import is_bench_log
from hexapod_cosim.extensions.identify.bench.log import GROUPINGS
from hexapod_cosim.extensions.identify.log import HELD_OUT, read_log
from hexapod_cosim.extensions.identify.numbers.servo import TERMS, with_friction_model
from hexapod_cosim.extensions.identify.unknowns import GROUPS
from hexapod_cosim.models import HexapodError, load_robot, unknown_name

SERVO_WORD = "servo"  # before logs of a servo bench
FOUND = ("servo", "mass", "contact", "sensor")  # without --find
Logs = Annotated[
    list[Path],
    typer.Argument(
        metavar="[servo] LOG...",
        help="CSV, Parquet or MCAP files with commands and readings, each from standing still on. "
        "Behind the word servo: JSON logs of one servo on a pendulum bench: an XL330 (BAM), or "
        "a STS3215 or STS3250 (K-Scale).",
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
    typer.Option(
        "--held-out", min=0.0, max=0.9, metavar="SHARE", help="Part of each log that only judges."
    ),
]
Friction = Annotated[
    str | None,
    typer.Option(
        "--friction",
        metavar="|".join(TERMS),
        help="Friction model of measured servos. Default: the terms of the robot file; of bench "
        "logs all are compared.",
    ),
]
HoldOut = Annotated[
    str,
    typer.Option(
        "--hold-out",
        metavar="|".join(GROUPINGS),
        help="Of bench logs: which ones are held out together, to judge a fit to the others.",
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
    hold_out: HoldOut = "gain",
    workers: Workers = None,
    output: Folder = None,
    json: Json = False,
) -> None:
    """Find a robot's masses, servos, contacts and sensors from its own logs."""
    if str(logs[0]) == SERVO_WORD:
        if find or held_out != HELD_OUT:
            what = "an option that does nothing for logs of a servo bench"
            given = "--find" if find else "--held-out"
            raise HexapodError(what, got=given, expected="none of it", fix="use --hold-out")
        _identify_servo(logs[1:], robot, friction, hold_out, workers, output, json)
        return
    # imported only here because they are slow to import
    from hexapod_cosim.cosim.run.worker_pool import processor_count  # noqa: PLC0415
    from hexapod_cosim.extensions.identify import identification, results  # noqa: PLC0415

    bench = [str(path) for path in logs if is_bench_log(path)]
    if bench:
        expected, fix = "the word servo before it", f"hexapod identify servo {' '.join(bench)}"
        raise HexapodError("a servo bench's log", got=bench[0], expected=expected, fix=fix)
    groups = _checked(find or list(FOUND))
    own = load_robot(robot)
    if friction is not None:
        own = with_friction_model(own, friction)
    recorded = [read_log(path, robot=own) for path in logs]
    with results_folder(output or Path("out") / "identify", own=results.FILES) as folder:
        found = identification.identify(
            recorded,
            own,
            groups=groups,
            held_out=held_out,
            workers=workers or processor_count(),
            progress=(lambda _text: None) if json else _show_step,
        )
        folder.begin()
        share = None if held_out == HELD_OUT else held_out
        options = {"robot": robot, "find": find, "friction": friction, "held_out": share}
        command = command_line("identify", *logs, **options)
        written = results.write_identified(found, robot, folder.path, command=command)
    for text in results.warnings(found):
        warn(text.removesuffix("."))
    if json:
        show_json({**results.result_table(found), "files": [str(path) for path in written]})
        return
    shown, zero = results.estimate_rows(found.estimates)
    show_table(results.ESTIMATES, shown, right=(2, 3, 4))
    if zero:
        show_text(f"{zero} biases of sensors may be 0; sensors.toml has them.")
    show_table(results.ERRORS, results.error_rows(found), right=(2, 3, 4, 5, 6))
    show_text(results.open_text(found))
    show_files(written)


def _identify_servo(
    logs: Sequence[Path],
    robot: str,
    friction: str | None,
    by: str,
    workers: int | None,
    output: Path | None,
    json: bool,
) -> None:
    # imported only here because they are slow to import
    from hexapod_cosim.cosim.run.worker_pool import processor_count  # noqa: PLC0415
    from hexapod_cosim.extensions.identify.bench import command  # noqa: PLC0415

    if by not in GROUPINGS:
        raise unknown_name("grouping of logs", by, GROUPINGS, where="--hold-out")
    if not logs:
        got, expected = f"the word {SERVO_WORD!r} alone", "JSON files of BAM or K-Scale behind it"
        fix = "hexapod identify servo logs/*.json"
        raise HexapodError("no bench logs", got=got, expected=expected, fix=fix)
    options = {"robot": robot, "hold_out": by, "friction": friction}
    own = load_robot(robot)
    with results_folder(output or Path("out") / "identify") as folder:
        found = command.identified_servo(
            logs,
            own,
            friction=friction,
            by=by,
            workers=workers or processor_count(),
            progress=(lambda _text: None) if json else _show_step,
        )
        folder.begin()
        written = command_line("identify", SERVO_WORD, *logs, **options)
        files = command.write_servo(found, folder.path, command=written, by=by)
    for text in command.motor_warnings(own, found.held_out[0][0].motor):
        warn(text.removesuffix("."))
    if json:
        show_json({**command.result_table(found), "files": [str(path) for path in files]})
        return
    show_table(command.NUMBERS, command.number_rows(found), right=(2, 3, 4))
    show_table(("held out", *command.ERRORS), command.error_rows(found), right=(1, 2, 3, 4))
    show_text(command.worth(found, by))
    show_files(files)


def _show_step(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _checked(names: Sequence[str]) -> list[str]:
    """Returns the groups. Raises HexapodError for an unknown one."""
    for name in names:
        if name not in GROUPS:
            raise unknown_name("group of numbers", name, GROUPS, where="--find")
    return list(names)
