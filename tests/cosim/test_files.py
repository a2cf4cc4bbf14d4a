"""Files are written completely or not at all."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common.files import atomic_path, write_text
from hexapod_cosim.models import HexapodError


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
