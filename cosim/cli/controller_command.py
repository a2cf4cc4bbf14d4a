"""Defines the command `hexapod controller new`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.options import Json
from hexapod_cosim.cosim.cli.terminal import show_files, show_json, show_text
from hexapod_cosim.cosim.control.new_law import class_name, write_law

app = typer.Typer(
    no_args_is_help=True, rich_markup_mode=None, help="Write a controller of your own."
)


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
    files = write_law(name, output)
    if json:
        show_json({"class": class_name(name), "files": [str(file) for file in files]})
        return
    show_files(files)
    show_text(f"hexapod simulate walk_flat --control {files[0]}:{class_name(name)}")
