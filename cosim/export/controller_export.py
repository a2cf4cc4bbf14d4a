"""Writes a controller's FMU: the C controller with the setup of a Python controller."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from hexapod_cosim.cosim.export.export import export_interface
from hexapod_cosim.cosim.interface.controller_interface import (
    ControllerSetup,
    load_controller_interface,
)


def export_controller(
    setup: ControllerSetup,
    path: str | Path,
    *,
    fmi: int = 2,
    platforms: Iterable[str] | None = None,
    integers: bool = False,
) -> Path:
    """Writes a controller's FMU and returns its path.

    Arguments and errors are those of `export_fmu`; also raises the errors of `Controller`.
    """
    return export_interface(
        load_controller_interface(setup), path, fmi=fmi, platforms=platforms, integers=integers
    )
