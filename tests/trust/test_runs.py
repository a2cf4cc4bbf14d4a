"""Tests that runs share nothing: one writer for a folder, no files left behind, results on disk."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common import files
from hexapod_cosim.cosim.common import temporary as temporaries
from hexapod_cosim.cosim.results.folder import results_folder
from hexapod_cosim.models import HexapodError

HOLD = """
import sys
from pathlib import Path
from hexapod_cosim.cosim.common.temporary import TemporaryFolder
from hexapod_cosim.cosim.results.folder import results_folder
folder = TemporaryFolder("fmu")
with results_folder(Path(sys.argv[1])):
    print(folder.path, flush=True)
    sys.stdin.read()
"""


def holder(folder: Path, temporary: Path) -> subprocess.Popen[str]:
    """Starts a process that writes results into a folder and has an FMU unpacked."""
    return subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"TMPDIR": str(temporary)},
        text=True,
    )


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The system's temporary folder for this test and its processes."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def test_a_second_process_is_refused_and_the_lock_of_a_killed_one_is_free(
    tmp_path: Path, temporary: Path
) -> None:
    folder = tmp_path / "out"
    process = holder(folder, temporary)
    assert process.stdout is not None
    process.stdout.readline()
    with (
        pytest.raises(HexapodError, match="another process writes its results into this folder"),
        results_folder(folder),
    ):
        pass
    process.send_signal(signal.SIGKILL)
    process.wait()
    with results_folder(folder):
        pass
    process.stdout.close()


def test_the_lock_is_of_the_folder_and_leaves_no_file(tmp_path: Path, temporary: Path) -> None:
    folder, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    process = holder(folder, elsewhere)  # with another temporary folder
    assert process.stdout is not None
    process.stdout.readline()
    with (
        pytest.raises(HexapodError, match="another process writes its results into this folder"),
        results_folder(folder),
    ):
        pass
    process.communicate()
    with results_folder(folder):
        pass
    assert list(temporary.iterdir()) == []
    assert not list(elsewhere.glob("*.lock"))
    process.stdout.close()


def test_the_unpacked_folder_of_a_killed_process_is_deleted_by_the_next(
    tmp_path: Path, temporary: Path
) -> None:
    process = holder(tmp_path / "out", temporary)
    assert process.stdout is not None
    left = Path(process.stdout.readline().strip())
    later = left.stat().st_mtime + 1000.0
    assert temporaries.sweep(now=later) == []  # in use
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert temporaries.sweep(now=left.stat().st_mtime) == []  # may not have its lock yet
    assert temporaries.sweep(now=later) == [left]
    assert not left.exists()
    process.stdout.close()


COMMANDS = {
    "simulate": ("simulate", "walk_flat", "--set", "duration=1000"),
    "compare": ("compare", "walk_flat", "--set", "duration=1000"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_killed_command_leaves_nothing_that_the_next_does_not_delete(
    plant_build: Path, tmp_path: Path, temporary: Path, name: str
) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "hexapod_cosim.cosim.cli", *COMMANDS[name], "-o", "out"],
        cwd=tmp_path,
        env=os.environ | {"TMPDIR": str(temporary)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    recording = f"*/{files.RUN_FILE}" if name == "compare" else files.RUN_FILE
    while process.poll() is None and not list((tmp_path / "out").glob(recording)):
        time.sleep(0.01)
    process.kill()
    assert process.wait() == -signal.SIGKILL
    left = [path for path in temporary.iterdir() if path.name.startswith("hexapod-")]
    assert left
    assert temporaries.sweep(now=time.time() + 1000.0)
    assert list(temporary.iterdir()) == []
