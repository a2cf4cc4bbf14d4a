"""Calls a function in a new Python process, so that a crash in it ends that process alone.

    python -m hexapod_cosim.cosim.common.own_process MODULE FUNCTION FILE RESULT

calls FUNCTION of MODULE with the path FILE and writes what it returns into RESULT as JSON.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from hexapod_cosim.cosim.common.temporary import TemporaryFolder

TIME_LIMIT = 120.0  # s
LAST_WORDS = 300  # characters of the process's messages that an error quotes


class ProcessEndedError(Exception):
    """The process ended before the function returned; the message says how."""


def call_in_process(
    function: Callable[[Path], Any], path: Path, *, limit: float = TIME_LIMIT
) -> Any:
    """Returns function(path), called in a new process of this Python.

    Args:
        function: a function of a module that can be imported; its result is JSON.
        path: its argument.
        limit: longest time of the call [s].

    Raises ProcessEndedError when the process crashes, takes longer or raises an exception.
    """
    with TemporaryFolder("process") as folder:
        result = folder / "result.json"
        place = [function.__module__, function.__name__, str(path.absolute()), str(result)]
        command = [sys.executable, "-m", __spec__.name, *place]
        try:
            done = subprocess.run(
                command, capture_output=True, stdin=subprocess.DEVNULL, timeout=limit, check=False
            )
        except subprocess.TimeoutExpired:
            raise ProcessEndedError(f"no result after {limit:g} s") from None
        with suppress(OSError, ValueError):
            return json.loads(result.read_text(encoding="utf-8"))
    raise ProcessEndedError(_how(done.returncode, done.stderr.decode(errors="replace")))


def _how(code: int, errors: str) -> str:
    """Returns how a process ended, from its exit code and its messages."""
    if code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"
    if code > 0xFF:  # an exception code of Windows
        return f"exception 0x{code & 0xFFFFFFFF:08X}"
    last = errors.strip().rpartition("\n")[2][-LAST_WORDS:]
    return f"exit code {code}" + (f" ({last})" if last else "")


def main() -> None:
    """Calls the function that the command line names and writes its result."""
    module, name, path, result = sys.argv[1:]
    found = getattr(import_module(module), name)(Path(path))
    Path(result).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
