"""Defines the command `hexapod validate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hexapod_cosim.cosim.cli.options import Json


def validate(
    fmu: Annotated[Path, typer.Argument(metavar="FILE.fmu", help="The FMU to check.")],
    json: Json = False,
) -> None:
    """Check an FMU of ours and say what is wrong."""
    from hexapod_cosim.cosim.cli.terminal import show_json
    from hexapod_cosim.cosim.export.validation import UnsoundFmuError, find_problems

    problems = find_problems(fmu)
    if problems:
        if not json:
            print("\n".join(problems))
        raise UnsoundFmuError(fmu, problems)
    if json:
        show_json({"fmu": str(fmu), "valid": True, "problems": []})
    else:
        print(f"{fmu}: no problems found")
