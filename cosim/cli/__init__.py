"""The `hexapod` command: parse, call one function, exit code. 0 only on success; an error is one paragraph on stderr.

Nothing slow is imported before `main` guards it, so Ctrl-C at any time ends in one line.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence

FAILURE, INTERRUPT = 1, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line. Returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = _run(given)
    except KeyboardInterrupt:
        code = INTERRUPT
    except Exception as error:
        if "--debug" in given:
            raise
        print(f"hexapod: unexpected {type(error).__name__}: {error}; run `hexapod --debug ...` to see where", file=sys.stderr)
        return FAILURE
    if code == INTERRUPT:
        print("hexapod: interrupted", file=sys.stderr)
    return code


def _run(given: list[str]) -> int:
    from hexapod_cosim.cosim.cli.app import app  # noqa: PLC0415  a second of imports, in which Ctrl-C may come
    from hexapod_cosim.cosim.interrupts import termination_as_interrupt  # noqa: PLC0415
    from hexapod_cosim.models import HexapodError  # noqa: PLC0415

    try:
        with termination_as_interrupt():
            app(args=given, prog_name="hexapod")
    except SystemExit as stop:  # typer ends so, after Ctrl-C too: it keeps KeyboardInterrupt to itself
        return 0 if stop.code is None else stop.code if isinstance(stop.code, int) else FAILURE
    except HexapodError as error:
        print(f"hexapod: {error}", file=sys.stderr)
        if "--debug" in given:
            traceback.print_exception(error)
    return FAILURE
