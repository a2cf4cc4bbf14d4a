"""How a command ends: its exit code, a paragraph on stderr where it failed and, with --json, the
same as an object on stdout.

Imports nothing slow: `main` needs it before it can hear Ctrl-C.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from typing import Any

from hexapod_cosim.cosim.cli.width import fitted

SUCCESS, FAILURE, USAGE, FELL, INTERRUPT = 0, 1, 2, 3, 130
EXIT_CODES = {
    SUCCESS: "success",
    FAILURE: "an error, told on stderr",
    USAGE: "a command line that is not understood",
    FELL: "the robot fell; results are complete and written",
    INTERRUPT: "interrupted",
}
EPILOG = (
    "Exit codes: " + "; ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items()) + "."
)
OF_ERRORS = ("what", "got", "expected", "fix", "where")  # attributes of a HexapodError


def tell_failure(text: str, code: int, *, error: BaseException | None = None, as_json: bool) -> int:
    """Says on stderr why a command failed, with `as_json` also on stdout; returns the exit code.

    error: whose attributes go into the object; `found`, where it has one, is what the command has
    to say besides.
    """
    print(fitted(f"hexapod: {text}", sys.stderr), file=sys.stderr)
    if as_json:
        print(json.dumps(error_object(text, code, error), indent=2, ensure_ascii=False))
    return code


def error_object(text: str, code: int, error: BaseException | None = None) -> dict[str, Any]:
    """What --json prints of a failure: the whole message, its parts (null where there is none)
    and the exit code.
    """
    found = _plain(getattr(error, "found", {}))
    return {
        **found,
        "error": text,
        **{name: _plain(getattr(error, name, None)) for name in OF_ERRORS},
        "exit_code": code,
    }


def _plain(value: Any) -> Any:
    """The value as JSON holds it; what JSON does not know as Python shows it."""
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else repr(value)
