"""Writes the reference of the `hexapod` command from its --help, with typer's own tool."""

from __future__ import annotations

import subprocess
import sys

DOCUMENT = [
    sys.executable,
    "-m",
    "typer",
    "hexapod_cosim.cosim.cli.app",
    "utils",
    "docs",
    "--name",
    "hexapod",
    "--title",
    "Commands",
]


def page() -> str:
    """Returns the page on all commands."""
    return subprocess.run(DOCUMENT, capture_output=True, text=True, check=True).stdout
