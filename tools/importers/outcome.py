"""Runs adapters of other tools and checks the results."""

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
    """The result of a tool: a row of a table."""

    @property
    def name(self) -> str: ...
    @property
    def missing(self) -> bool: ...  # whether the tool could not be installed
    @property
    def agrees(self) -> bool: ...  # whether it ran with the expected outputs


def version(distribution: str, python: Path) -> str:
    """Returns the version of a package in the tools' environment; "" without the package."""
    code = f"from importlib.metadata import version; print(version({distribution!r}))"
    return subprocess.run(
        [str(python), "-c", code], capture_output=True, text=True, check=False
    ).stdout.strip()


def not_installed(distributions: Iterable[str], python: Path) -> str:
    """Returns a message about missing packages of a tool; "" if there are none."""
    lacking = [name for name in distributions if not version(name, python)]
    return f"could not be installed: {', '.join(lacking)}" if lacking else ""


def answers(command: Sequence[str | Path], outputs: Path) -> tuple[Recording | None, str]:
    """Runs an adapter; returns its outputs, or None and its error message.

    An output file of an earlier run is deleted first.
    """
    outputs.unlink(missing_ok=True)
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False
    )
    if done.returncode:
        return None, f"failed ({done.returncode}): {last_lines(done.stderr or done.stdout)}"
    try:
        return read_csv(outputs), ""
    except HexapodError as error:
        return None, f"failed: it exited with 0 but wrote no outputs: {error}"


def last_lines(text: str) -> str:
    """Returns the last lines of a program's messages in one line."""
    return " / ".join(text.strip().splitlines()[-LAST_LINES:])


def shortcomings(kind: str, outcomes: Collection[Outcome], *, wanted: int) -> list[str]:
    """Returns the failures of other tools, one sentence each.

    All tools that could be installed must agree, and none may be left out.
    """
    found = [f"{one.name} does not agree" for one in outcomes if not (one.missing or one.agrees)]
    settled = sum(one.missing or one.agrees for one in outcomes)
    if settled < wanted:
        found.append(f"{settled} of {wanted} {kind} agree or could not be installed")
    return found
