"""The examples run and say what they should."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tools.importers.capabilities import FOUND

EXAMPLES = sorted((Path(__file__).resolve().parents[2] / "examples").glob("*.py"))
SAYS = {
    "01_stand.py": ["sum 54.936 N, weight 54.936 N"],
    "02_walk.py": ["completed", "slip_per_metre", "cost_of_transport"],
    "03_own_controller.py": ["completed", "deg"],
    "04_two_fmus.py": ["40 measurements, 72 commands", "walks 0.37"],
    "06_tunable.py": ["servo.kp 40 -> 69.6 N m/rad", "energy audit"],
    "08_block_parameters.py": [
        "foot.radius is none of them",
        "1 s, 129.10 mm high: torso.mass = 4",
        "1.5 s, 126.17 mm high",
        "scenario with the same events: 126.17 mm high",
    ],
    "07_casadi.py": [
        "gradient    -3.72",
        "e-04 -6.82",
        "differences -3.72",
        "e-04 -6.84",
        "cost 0.001857, simulated 0.001857",
        # a package of 280 MB, which `make test-importers` installs
        FOUND if find_spec("casadi") else "without casadi nothing is tuned",
    ],
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
