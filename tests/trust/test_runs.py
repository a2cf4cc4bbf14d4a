"""Tests that runs share nothing: one writer for a folder, files that are written completely or not
at all, results on disk.
"""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common.files import atomic_path, write_text
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


def assert_held(process: subprocess.Popen[str], folder: Path) -> None:
    """Waits until a process holds its folder, which is refused to others."""
    assert process.stdout is not None
    process.stdout.readline()
    with (
        pytest.raises(HexapodError, match="another process writes its results into this folder"),
        results_folder(folder),
    ):
        pass


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
    assert_held(process, folder)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    with results_folder(folder):
        pass


def test_the_lock_is_of_the_folder_and_leaves_no_file(tmp_path: Path, temporary: Path) -> None:
    folder, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.mkdir()
    process = holder(folder, elsewhere)  # with another temporary folder
    assert_held(process, folder)
    process.communicate()
    with results_folder(folder):
        pass
    assert list(temporary.iterdir()) == []
    assert not list(elsewhere.glob("*.lock"))


# Files are written completely or not at all.


@pytest.mark.parametrize("name", [".", "folder"])
def test_a_folder_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).mkdir(exist_ok=True)
    before = sorted(tmp_path.iterdir())
    with (
        pytest.raises(
            HexapodError, match=r"cannot write: got 'a folder', expected the name of a file"
        ),
        atomic_path(Path(name)),
    ):
        pytest.fail("a place to write to was handed out")
    assert sorted(tmp_path.iterdir()) == before


def half_written(path: Path) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text("half")
        raise ZeroDivisionError


def test_a_block_that_fails_leaves_the_earlier_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "file.txt"
    write_text(path, "earlier")
    with pytest.raises(ZeroDivisionError):
        half_written(path)
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no file mode creation mask")
@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600)])
def test_a_written_file_has_the_permissions_of_the_mask(
    tmp_path: Path, mask: int, mode: int
) -> None:
    before = os.umask(mask)
    try:
        write_text(tmp_path / "file.txt", "text")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "file.txt").stat().st_mode) == mode


def test_a_file_that_cannot_be_made_is_reported_with_its_folder(tmp_path: Path) -> None:
    with pytest.raises(HexapodError, match="cannot write: got 'No such file or directory'"):
        write_text(tmp_path / "missing" / "file.txt", "text")
    assert list(tmp_path.iterdir()) == []
