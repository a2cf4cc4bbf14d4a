"""Copies the example programs and notebooks that come with this package."""

from __future__ import annotations

import shutil
from pathlib import Path

from hexapod_cosim.cosim.common.files import writing_into
from hexapod_cosim.cosim.common.plant_files import in_source_tree
from hexapod_cosim.models.errors import HexapodError

_PACKAGE = Path(__file__).resolve().parents[2]
UNWANTED = shutil.ignore_patterns("__pycache__", ".*")


def copy_examples(folder: Path) -> list[Path]:
    """Copies programs and controllers into a folder, and notebooks into its folder notebooks.

    Returns the copied files, sorted. Raises HexapodError when the folder exists and is not empty,
    or cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise HexapodError(
            "the examples need a folder of their own",
            got=f"{folder}, which exists",
            expected="a new or an empty folder",
            fix="choose another one with -o",
        )
    notebooks = _PACKAGE / ("docs/notebooks" if in_source_tree() else "notebooks")
    with writing_into(folder):
        shutil.copytree(_PACKAGE / "examples", folder, dirs_exist_ok=True, ignore=UNWANTED)
        shutil.copytree(notebooks, folder / "notebooks", ignore=UNWANTED)
    return sorted(path for path in folder.rglob("*") if path.is_file())
