"""What came of tools that no one here wrote: their answers, why there are none, and whether that
is good enough.
"""

from __future__ import annotations

import subprocess
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Protocol

from hexapod_cosim.cosim.master.recorder import Recording
from hexapod_cosim.cosim.results.recordings import read_csv
from hexapod_cosim.models import HexapodError

LAST_LINES = 3


class Outcome(Protocol):
    """A row of a table."""

    @property
    def name(self) -> str: ...
    @property
    def missing(self) -> bool: ...  # the tool could not be installed on this machine
    @property
    def agrees(self) -> bool: ...  # it ran, and its answers are the expected ones


def version(distribution: str, python: Path) -> str:
    """Of a package in the tools' environment; "" if it is not there."""
    code = f"from importlib.metadata import version; print(version({distribution!r}))"
    return subprocess.run(
        [str(python), "-c", code], capture_output=True, text=True, check=False
    ).stdout.strip()


def not_installed(distributions: Iterable[str], python: Path) -> str:
    """Which packages of a tool could not be installed, "" when it can run."""
    lacking = [name for name in distributions if not version(name, python)]
    return f"could not be installed: {', '.join(lacking)}" if lacking else ""


def answers(command: Sequence[str | Path], outputs: Path) -> tuple[Recording | None, str]:
    """What an adapter wrote, or None and what it said; what an earlier one wrote does not count."""
    outputs.unlink(missing_ok=True)
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False
    )
    if done.returncode:
        return None, f"failed ({done.returncode}): {last_lines(done.stderr or done.stdout)}"
    try:
        return read_csv(outputs), ""
    except HexapodError as error:
        return None, f"failed: it ended well and left no answers: {error}"


def last_lines(text: str) -> str:
    """The end of what a program said, in one line."""
    return " / ".join(text.strip().splitlines()[-LAST_LINES:])


def shortcomings(kind: str, outcomes: Collection[Outcome], *, wanted: int) -> list[str]:
    """Why the outcomes of foreign tools are not good enough, a sentence each: all that could be
    installed agree, and none is left out.
    """
    found = [f"{one.name} does not agree" for one in outcomes if not (one.missing or one.agrees)]
    settled = sum(one.missing or one.agrees for one in outcomes)
    if settled < wanted:
        found.append(f"{settled} of {wanted} {kind} agree or could not be installed")
    return found
