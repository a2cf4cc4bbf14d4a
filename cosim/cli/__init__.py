"""The `hexapod` command.

The exit code is 0 only on success. An error is one paragraph on stderr and, with --json, an object
on stdout as well. Slow imports happen inside `main`, so that Ctrl-C at any time ends in one line.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence
from typing import Any

from hexapod_cosim.cosim.cli.failures import (
    FAILURE,
    INTERRUPT,
    SUCCESS,
    USAGE,
    report_failure,
    usage_parts,
)
from hexapod_cosim.cosim.cli.terminal import json_alone


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line and returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = _run(given)
    except KeyboardInterrupt:
        code = INTERRUPT
    except Exception as error:
        if "--debug" in given:
            raise
        return report_failure(_explained(error), FAILURE, as_json=_wants_json(given))
    if code == INTERRUPT:
        return report_failure("interrupted", INTERRUPT, as_json=_wants_json(given))
    return code


def _explained(error: Exception) -> str:
    """Returns the message for an error that is none of ours, such as one of the system."""
    from hexapod_cosim.models.errors import shortened

    kind = "" if isinstance(error, OSError) else f"unexpected {type(error).__name__}: "
    return f"{kind}{shortened(str(error))}; run `hexapod --debug ...` to see where"


def _wants_json(given: Sequence[str]) -> bool:
    """Returns whether --json was given, even on a command line that cannot be parsed."""
    return "--json" in given


def _run(given: list[str]) -> int:
    import typer

    from hexapod_cosim.cosim.cli.app import app
    from hexapod_cosim.cosim.master.interrupts import termination_as_interrupt

    usage_error: Any = typer.BadParameter.__mro__[1]  # typer does not export it
    json = _wants_json(given) and "--help" not in given
    try:
        with termination_as_interrupt(), json_alone(wanted=json):
            code = app(args=given, prog_name="hexapod", standalone_mode=False)
    except usage_error as error:
        return _usage(error, given)
    except SystemExit as stop:  # how typer ends after it has answered a shell's completion
        if stop.code is None:
            return SUCCESS
        return stop.code if isinstance(stop.code, int) else FAILURE
    except Exception as error:
        from hexapod_cosim.models import HexapodError

        if not isinstance(error, HexapodError):
            raise
        report_failure(str(error), FAILURE, error=error, as_json=_wants_json(given))
        if "--debug" in given:
            traceback.print_exception(error)
        return FAILURE
    # typer turns KeyboardInterrupt into an exit code
    return code if isinstance(code, int) else SUCCESS


def _usage(error: Any, given: Sequence[str]) -> int:
    """Reports words that are no command, or shows the help. Returns the exit code."""
    from hexapod_cosim.models import HexapodError

    if error.format_message().startswith("Usage:"):  # of a command without a sub-command
        print(error.format_message(), file=sys.stderr)
        return USAGE
    got, expected, fix = usage_parts(error)
    failure = HexapodError("not understood", got=got, expected=expected, fix=fix)
    return report_failure(str(failure), USAGE, error=failure, as_json=_wants_json(given))
