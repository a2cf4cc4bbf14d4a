"""The reference of the `hexapod` command: what its --help says, written down by typer's own
tool.
"""

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
    """The page on all commands."""
    return subprocess.run(DOCUMENT, capture_output=True, text=True, check=True).stdout
