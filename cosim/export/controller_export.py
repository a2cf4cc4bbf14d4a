"""Packs a controller as an FMU: the C controller with the set-up that the Python controller of a
run would have.
"""

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
) -> Path:
    """Writes a controller's FMU and returns its path; arguments and errors as of `export_fmu`,
    and what `Controller` refuses.
    """
    return export_interface(load_controller_interface(setup), path, fmi=fmi, platforms=platforms)
