"""Defines the commands `hexapod examples` and `hexapod controller new`: programs to begin with."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.options import Json
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_text
from hexapod_cosim.models.errors import HexapodError

app = typer.Typer(
    no_args_is_help=True, rich_markup_mode=None, help="Write a controller of your own."
)
PACKAGE = Path(__file__).resolve().parents[2]
UNWANTED = shutil.ignore_patterns("__pycache__", ".*")


def examples(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="New folder for the examples.")
    ] = Path("hexapod-examples"),
    json: Json = False,
) -> None:
    """Copy the example programs and notebooks into a folder, to run and to change."""
    files = copy_examples(output)
    if json:
        show_json({"files": [str(file) for file in files]})
    else:
        show_files(files)


def copy_examples(folder: Path) -> list[Path]:
    """Copies programs and controllers into a folder, and notebooks into its folder notebooks.

    Returns the copied files, sorted. Raises HexapodError when the folder exists and is not empty,
    or cannot be written.
    """
    from hexapod_cosim.cosim.common.files import writing_into
    from hexapod_cosim.cosim.common.plant_files import in_source_tree

    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise HexapodError(
            "the examples need a folder of their own",
            got=f"{folder}, which exists",
            expected="a new or an empty folder",
            fix="choose another one with -o",
        )
    notebooks = PACKAGE / ("docs/notebooks" if in_source_tree() else "notebooks")
    with writing_into(folder):
        shutil.copytree(PACKAGE / "examples", folder, dirs_exist_ok=True, ignore=UNWANTED)
        shutil.copytree(notebooks, folder / "notebooks", ignore=UNWANTED)
    return sorted(path for path in folder.rglob("*") if path.is_file())


@app.callback()
def controller() -> None:
    """Write a controller of your own."""


@app.command("new")
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the controller: my_walk.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder; default this one.")
    ] = Path(),
    json: Json = False,
) -> None:
    """Write NAME.py, a controller that walks, its test, and a line of README.md."""
    from hexapod_cosim.cosim.control.new_law import class_name, write_law

    files = write_law(name, output)
    if json:
        show_json({"class": class_name(name), "files": [str(file) for file in files]})
        return
    show_files(files)
    show_text(f"hexapod simulate walk_flat --control {files[0]}:{class_name(name)}")
