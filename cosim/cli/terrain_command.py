"""Defines the command `hexapod terrain`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli import completion
from hexapod_cosim.cosim.cli.options import Json


def terrain(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A ground of `hexapod list terrains`.",
            autocompletion=completion.terrain,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Draw the surface as PNG or SVG."),
    ] = None,
    heights: Annotated[
        Path | None,
        typer.Option("--heights", metavar="FILE", help="Write its heights as a 16-bit PNG."),
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Set a parameter of the surface: step_height=30mm.",
        ),
    ] = None,
    robot: Annotated[
        str,
        typer.Option(
            "--robot",
            metavar="FILE",
            help="The robot that is drawn for scale.",
            autocompletion=completion.robot,
        ),
    ] = "athena",
    json: Json = False,
) -> None:
    """Show a kind of ground: its size and parameters, its picture, its height map."""
    from hexapod_cosim.cosim.cli.terrains import ground_from, show_terrain

    ground = ground_from(name, values or [])
    show_terrain(ground, robot=robot, picture=output, heights=heights, as_json=json)
