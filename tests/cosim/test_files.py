"""Files are written completely or not at all."""

from __future__ import annotations

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
