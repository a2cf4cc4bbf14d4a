"""The wheel for Windows, in a Python for Windows under Wine (`make test-platforms`)."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hexapod_cosim.cosim.interface.names import vector_names
from hexapod_cosim.cosim.results.recordings import read_csv
from hexapod_cosim.models import JOINT_NAMES, LEG_NAMES
from tools.windows_python import PROGRAM, prepare

ROOT = Path(__file__).parents[2]
CACHE = ROOT / "build" / "windows"
WHEELS = Path(os.environ.get("HEXAPOD_WHEELS", ROOT / "dist"))
LIBM = 1e-14  # rad, of joint commands: the controllers use functions of each system's C library
MOTION = 1e-9  # m, of the torso: such differences grow at touch-downs
PATIENCE = 600  # seconds, of a command: Wine starts Python slowly
pytestmark = pytest.mark.skipif(
    os.environ.get("HEXAPOD_PLATFORMS") != "all", reason="takes minutes: make test-platforms"
)


class Windows:
    """Runs `hexapod` in the Python for Windows."""

    def __init__(self, python: Path, prefix: Path) -> None:
        self.python = python
        own = {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "ucrtbase=n,b"}
        self.environment = os.environ | own

    def run(self, cwd: Path, *arguments: str) -> str:
        """Runs a command that must succeed and returns its output."""
        process = subprocess.run(
            ["wine", str(self.python), "-c", PROGRAM, *arguments],
            cwd=cwd,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,  # this Python takes pipes under Wine, but no files
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        assert process.returncode == 0, process.stdout + process.stderr
        return process.stdout

    def end(self) -> None:
        """Ends Wine's server of this prefix."""
        subprocess.run(["wineserver", "-k"], env=self.environment, check=False)


@pytest.fixture(scope="module")
def windows(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Windows]:
    """A Python for Windows in which the wheel and its dependencies are installed."""
    (wheel,) = WHEELS.rglob("*win_amd64.whl")
    assert shutil.which("wine"), "needs Wine: tools/install_emulators.py"
    CACHE.mkdir(parents=True, exist_ok=True)
    running = Windows(prepare(wheel.resolve(), CACHE), tmp_path_factory.mktemp("wine"))
    yield running
    running.end()


def test_the_command_starts_under_windows(windows: Windows, tmp_path: Path) -> None:
    assert windows.run(tmp_path, "--version").strip() == "0.1.0"


def test_a_walk_under_windows_is_this_machine_s_up_to_rounding(
    windows: Windows, tmp_path: Path
) -> None:
    from hexapod_cosim.cosim.cli import main  # noqa: PLC0415

    walk = ["simulate", "walk_flat", "--control", "kinematic", "--set", "duration=0.5 s"]
    walk += ["--set", "outputs.plots=false", "-o"]
    windows.run(tmp_path, *walk, "there")
    assert main([*walk, str(tmp_path / "here")]) == 0
    there, here = (read_csv(tmp_path / place / "results.csv") for place in ("there", "here"))
    assert there.names == here.names
    angles = [f"{leg}.{joint}.angle_ref" for leg in LEG_NAMES for joint in JOINT_NAMES]
    assert np.abs(there.columns(angles) - here.columns(angles)).max() <= LIBM
    position = vector_names("torso.position")
    assert np.abs(there.columns(position) - here.columns(position)).max() <= MOTION
    facts = json.loads((tmp_path / "there" / "run.json").read_text(encoding="utf-8"))
    assert facts["status"] == "completed"


def test_an_fmu_is_exported_and_validated_under_windows(windows: Windows, tmp_path: Path) -> None:
    windows.run(tmp_path, "export", "-o", "athena.fmu")
    assert "no problems found" in windows.run(tmp_path, "validate", "athena.fmu")
