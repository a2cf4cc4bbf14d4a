"""Writes a controller's FMU: the C controller with the setup of a Python controller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType

from hexapod_cosim.cosim.export.plant_export import export_interface
from hexapod_cosim.cosim.export.starts import with_starts
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
    starts: Mapping[str, float] = MappingProxyType({}),
    bare: bool = False,
) -> Path:
    """Writes a controller's FMU and returns its path.

    Arguments and errors are those of `export_fmu`; also raises the errors of `Controller`.
    """
    interface = with_starts(load_controller_interface(setup), starts)
    return export_interface(
        interface, path, fmi=fmi, platforms=platforms, integers=integers, bare=bare
    )
