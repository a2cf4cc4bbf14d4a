"""Tests that the shared libraries of plant and controller may be loaded into one process with their
symbols global, as several importers do.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import lief
import pytest
from building import shared_library

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="RTLD_GLOBAL is of ELF systems")

# loads libraries in the given order, asks each for instances with a wrong GUID, and prints how many
# were refused
LOAD = """
import ctypes, sys
name, guid = b"instance", b"{00000000-0000-0000-0000-000000000000}"
refused = 0
libraries = [ctypes.CDLL(path, mode=ctypes.RTLD_GLOBAL) for path in sys.argv[1:]]
for library in libraries:
    for function, arguments in (
        ("fmi2Instantiate", (name, 1, guid, None, None, 0, 0)),
        ("fmi2Instantiate", (name, 0, guid, None, None, 0, 0)),
        ("fmi3InstantiateCoSimulation", (name, guid, None, 0, 0, 0, 0, None, 0, None, None, None)),
        ("fmi3InstantiateModelExchange", (name, guid, None, 0, 0, None, None)),
        ("fmi3InstantiateScheduledExecution", (name, guid, None, 0, 0, *5 * [None])),
    ):
        call = getattr(library, function)
        call.restype = ctypes.c_void_p
        refused += call(*arguments) is None
print(refused)
"""


@pytest.fixture(scope="module")
def both(plant_build: Path) -> list[Path]:
    """The libraries of the plant's and of the controller's FMU."""
    return [
        shared_library(plant_build, "plant_fmu", "hexapod"),
        shared_library(plant_build, "controller/fmu", "hexapod_controller"),
    ]


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_an_instance_is_refused_by_its_own_library(
    both: list[Path], order: tuple[int, int]
) -> None:
    environment = os.environ | {"MALLOC_PERTURB_": "190"}  # fills memory that was freed
    done = subprocess.run(
        [sys.executable, "-c", LOAD, *(str(both[index]) for index in order)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout.strip()) == (0, "10"), done.stderr


@pytest.mark.parametrize("component", range(2))
def test_no_library_looks_for_its_own_functions_elsewhere(both: list[Path], component: int) -> None:
    library: Any = lief.parse(str(both[component]))
    exported = {symbol.name for symbol in library.exported_symbols}
    looked_up = {place.symbol.name for place in library.relocations if place.has_symbol}
    assert "fmi2FreeInstance" in exported
    assert looked_up & exported == set()
