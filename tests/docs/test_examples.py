"""The examples run and say what they should."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("*.py"))
SAYS = {
    "01_stand.py": ["sum 54.936 N, weight 54.936 N"],
    "02_walk.py": ["completed", "slip_per_metre", "cost_of_transport"],
    "03_own_controller.py": ["completed", "deg"],
    "04_two_fmus.py": ["40 measurements, 72 commands", "walks 0.37"],
    "05_robot_log.py": ["log.mcap: 801 rows, 108 columns", "hexapod identify log.mcap"],
}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_an_example_runs_from_any_folder(path: Path, tmp_path: Path, plant_build: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(path)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert all(text in done.stdout for text in SAYS[path.name]), done.stdout
    assert not list(tmp_path.iterdir())
