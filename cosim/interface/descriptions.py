"""Reads model descriptions of FMUs with fmpy."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

from fmpy import read_model_description

from hexapod_cosim.models.errors import FmuError

FIX = "make one with `hexapod export -o FILE.fmu`"


def read_description(path: Path) -> Any:
    """Returns fmpy's model description of an FMI 2.0 co-simulation FMU.

    Raises FmuError for any other file.
    """
    description = open_description(path)
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        kind = "co-simulation" if description.coSimulation else "model exchange only"
        raise FmuError(
            "wrong kind of FMU",
            got=f"FMI {description.fmiVersion}, {kind}",
            expected="FMI 2.0 for co-simulation",
            fix=FIX,
            where=str(path),
        )
    return description


def open_description(path: Path) -> Any:
    """Returns fmpy's model description of an FMU of any version.

    Raises FmuError for a file that is no FMU.
    """
    if not path.is_file():
        raise FmuError("no such FMU", got=str(path), expected="an existing .fmu file", fix=FIX)
    try:
        description = read_model_description(path, validate=False)
    except (zipfile.BadZipFile, KeyError) as error:
        raise FmuError(
            "not an FMU",
            got=error.args[0],
            expected="a ZIP file with a modelDescription.xml",
            fix=FIX,
            where=str(path),
        ) from error
    except Exception as error:
        raise FmuError(
            "the FMU's modelDescription.xml cannot be read",
            got=str(error),
            fix=FIX,
            where=str(path),
        ) from error
    return description
