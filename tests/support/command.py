"""Runs the hexapod command in the test process."""

from __future__ import annotations

import sys
from collections.abc import Callable

COMMAND = [sys.executable, "-m", "hexapod_cosim.cosim.cli"]
QUICK = ["--set", "duration=0.2", "--set", "outputs.plots=false"]

Call = Callable[..., tuple[int, str, str]]


def settings(*pairs: str) -> list[str]:
    return [word for pair in pairs for word in ("--set", pair)]


def assert_refused(outcome: tuple[int, str, str], *parts: str) -> None:
    """Asserts that the exit code is not 0, stdout is empty, and stderr is one paragraph without a
    traceback that contains the parts.
    """
    code, out, err = outcome
    assert code not in (0, None)
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("hexapod: ")
    assert "Traceback" not in err
    for part in parts:
        assert part in err
