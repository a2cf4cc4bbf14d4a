"""The `hexapod` command: parse, call one function, exit code. 0 only on success; an error is one
paragraph on stderr, and with --json an object on stdout as well.

Nothing slow is imported before `main` guards it, so Ctrl-C at any time ends in one line.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence
from typing import Any

from hexapod_cosim.cosim.cli.failures import FAILURE, INTERRUPT, SUCCESS, USAGE, tell_failure


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
        text = f"unexpected {type(error).__name__}: {error}; run `hexapod --debug ...` to see where"
        return tell_failure(text, FAILURE, as_json=_wants_json(given))
    return (
        tell_failure("interrupted", INTERRUPT, as_json=_wants_json(given))
        if code == INTERRUPT
        else code
    )


def _wants_json(given: Sequence[str]) -> bool:
    """Whether --json was typed, also on a command line that cannot be parsed."""
    return "--json" in given


def _run(given: list[str]) -> int:
    import typer  # noqa: PLC0415  a second of imports, in which Ctrl-C may come

    from hexapod_cosim.cosim.cli.app import app  # noqa: PLC0415
    from hexapod_cosim.cosim.master.interrupts import termination_as_interrupt  # noqa: PLC0415
    from hexapod_cosim.models import HexapodError  # noqa: PLC0415

    usage_error: Any = typer.BadParameter.__mro__[1]  # which typer does not export
    try:
        with termination_as_interrupt():
            code = app(args=given, prog_name="hexapod", standalone_mode=False)
    except usage_error as error:
        return _usage(error, given)
    except SystemExit as stop:  # typer ends so when it answers a shell
        return (
            SUCCESS if stop.code is None else stop.code if isinstance(stop.code, int) else FAILURE
        )
    except HexapodError as error:
        tell_failure(str(error), FAILURE, error=error, as_json=_wants_json(given))
        if "--debug" in given:
            traceback.print_exception(error)
        return FAILURE
    return (
        code if isinstance(code, int) else SUCCESS
    )  # after Ctrl-C too: typer keeps KeyboardInterrupt to itself


def _usage(error: Any, given: Sequence[str]) -> int:
    """One paragraph for words that are no command of ours; help where there are none at all.
    Returns the exit code.
    """
    from hexapod_cosim.models import HexapodError  # noqa: PLC0415

    if not given:
        print(error.format_message(), file=sys.stderr)
        return USAGE
    context = error.ctx  # None for an option without its value
    path, usage = (
        (context.command_path, context.command.get_usage(context)) if context else ("hexapod", "")
    )
    said, expected = (
        " ".join(text.split())
        for text in (error.format_message().rstrip("."), usage.removeprefix("Usage: "))
    )
    told = HexapodError(
        "not understood",
        got=said,
        expected=expected or "a value after it",
        fix=f"`{path} --help` explains it",
    )
    return tell_failure(str(told), USAGE, error=told, as_json=_wants_json(given))
