"""Runs short trials of endurance.py, each in its own process, so that a crash fails one
test only.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SHORT = {"instances": 500, "threads": 10, "clock": 5000}
SCRIPTS = Path(__file__).parent
SUPPORT = SCRIPTS.parent / "support"  # modules that the scripts import
TIMEOUT = 600  # s, much longer than any trial; calls that hang are ended


def outcome(script: str, *arguments: str) -> str:
    """Returns the output of a script; fails with its last lines unless it exits with 0."""
    command = [sys.executable, str(SCRIPTS / script), *arguments]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        timeout=TIMEOUT,
        env=os.environ | {"PYTHONPATH": str(SUPPORT)},
    )
    assert done.returncode == 0, (
        f"exit code {done.returncode}\n{done.stdout[-1000:]}{done.stderr[-3000:]}"
    )
    return done.stdout


@pytest.mark.parametrize(("trial", "count"), SHORT.items())
def test_a_trial_with_many_repetitions_succeeds(
    plant_library: Path, trial: str, count: int
) -> None:
    assert outcome("endurance.py", str(plant_library), trial, str(count)).startswith(trial)
