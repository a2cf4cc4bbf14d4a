"""Defines exit codes, and prints error messages on stderr and, with --json, on stdout.

It has no slow imports, because `main` needs it before it can handle Ctrl-C.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Mapping
from typing import Any

SUCCESS, FAILURE, USAGE, FELL, INTERRUPT = 0, 1, 2, 3, 130
EXIT_CODES = {
    SUCCESS: "success",
    FAILURE: "an error, with a message on stderr",
    USAGE: "a command line that is not understood",
    FELL: "the robot fell; results are complete and written",
    INTERRUPT: "interrupted",
}
EPILOG = (
    "Exit codes: " + "; ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items()) + "."
)
RUN_EPILOG = (
    f"Exit code {FELL} when the robot fell, or did not walk to the end of every run of a "
    "comparison: what was recorded and measured is written all the same, and a comparison is of "
    "the seeds on which both walked."
)
NO_COMMAND = re.compile("No such command '(.*?)'")  # what the parser says of one
OF_ERRORS = ("what", "got", "expected", "fix", "where")  # attributes of a HexapodError

# option that people expect -> setting that does what it would do
SETTINGS = {
    "--robot": "robot=athena",
    "--duration": "duration=4",
    "--seed": "seed=1",
    "--gravity": "gravity=1.62",
    "--macro-step": "macro_step=0.005",
    "--gait": "gait.name=ripple",
    "--period": "gait.period=0.8",
    "--terrain": "terrain.kind=rubble",
    "--friction": "friction.mu=0.4",
    "--mu": "friction.mu=0.4",
    "--vx": "command.vx=0.12",
    "--speed": "command.vx=0.12",
}


def report_failure(
    text: str, code: int, *, error: BaseException | None = None, as_json: bool
) -> int:
    """Prints why a command failed on stderr and, with `as_json`, on stdout; returns the exit code.

    error: its attributes go into the JSON object, and so do the entries of its attribute `found`.
    """
    print(f"hexapod: {text}", file=sys.stderr)
    if as_json:
        print(json.dumps(error_object(text, code, error), indent=2, ensure_ascii=False))
    return code


def error_object(text: str, code: int, error: BaseException | None = None) -> dict[str, Any]:
    """Returns the object that --json prints of a failure: message, its parts and the exit code."""
    found = _plain(getattr(error, "found", {}))
    return {
        **found,
        "error": text,
        **{name: _plain(getattr(error, name, None)) for name in OF_ERRORS},
        "exit_code": code,
    }


def _plain(value: Any) -> Any:
    """Returns a value that JSON can hold; other objects become their representation."""
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else repr(value)


def usage_parts(error: Any) -> tuple[str, str, str]:
    """Returns what was got and expected, and the fix, for a command line that is not understood.

    error: the exception of the parser; its `ctx` is None for an option without its value.
    """
    context, message = error.ctx, " ".join(error.format_message().rstrip(".").split())
    for refused in getattr(error.__cause__, "errors", list)():  # a value that typer does not name
        message = message.replace("Invalid value", f"Invalid value {refused['input']!r}", 1)
    if not context:
        return message, "a value after it", "`hexapod --help` explains it"
    path, fix = context.command_path, f"`{context.command_path} --help` explains it"
    unknown = NO_COMMAND.match(message)
    if unknown:
        from hexapod_cosim.models.errors import suggestion

        names = context.command.list_commands(context)
        fix = suggestion(unknown[1], names, otherwise=fix)
        return unknown[1], f"one of {', '.join(names)}", fix
    usage = " ".join([path, *context.command.collect_usage_pieces(context)])
    setting = SETTINGS.get(getattr(error, "option_name", "").replace("_", "-"))
    helps = " ".join(getattr(one, "help", None) or "" for one in context.command.params)
    if setting and "a key of the scenario" in helps:
        fix = f"write --set {setting}; {fix}"
    return message, usage, fix
