"""Defines exit codes, and prints error messages on stderr and, with --json, on stdout.

It has no slow imports, because `main` needs it before it can handle Ctrl-C.
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
    FAILURE: "an error, with a message on stderr",
    USAGE: "a command line that is not understood",
    FELL: "the robot fell; results are complete and written",
    INTERRUPT: "interrupted",
}
EPILOG = (
    "Exit codes: " + "; ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items()) + "."
)
OF_ERRORS = ("what", "got", "expected", "fix", "where")  # attributes of a HexapodError


def report_failure(
    text: str, code: int, *, error: BaseException | None = None, as_json: bool
) -> int:
    """Prints why a command failed on stderr and, with `as_json`, on stdout; returns the exit code.

    error: its attributes go into the JSON object, and so do the entries of its attribute `found`.
    """
    print(fitted(f"hexapod: {text}", sys.stderr), file=sys.stderr)
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
