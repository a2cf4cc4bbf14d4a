"""Defines the command `hexapod examples`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.options import Json
from hexapod_cosim.cosim.cli.terminal import show_files, show_json
from hexapod_cosim.cosim.common.examples import copy_examples


def examples(
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="New folder for the examples."),
    ] = Path("hexapod-examples"),
    json: Json = False,
) -> None:
    """Copy the example programs and notebooks into a folder, to run and to change."""
    files = copy_examples(output)
    if json:
        show_json({"files": [str(file) for file in files]})
        return
    show_files(files)
