"""Tests on which Linux systems the binaries run: the newest version of glibc that they ask for."""

from __future__ import annotations

import platform
import sys
import zipfile
from pathlib import Path
from typing import Any

import lief
import pytest
from building import PACKED

from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot

NEWEST = (2, 14)  # of x86-64, where memcpy got its present version

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64",
    reason="other systems have other versions",
)


def newer_symbols(data: bytes) -> list[str]:
    """Returns the symbols of a library that need a newer glibc."""
    binary: Any = lief.parse(list(data))
    found = []
    for symbol in binary.imported_symbols:
        version = symbol.symbol_version
        name = version.symbol_version_auxiliary.name if version.has_auxiliary_version else ""
        parts = name.removeprefix("GLIBC_").split(".")
        if name.startswith("GLIBC_") and tuple(map(int, parts)) > NEWEST:
            found.append(f"{symbol.name}@{name}")
    return found


def test_installed_libraries_need_no_glibc_after_2_14(plant_build: Path) -> None:
    libraries = {path.name: path for path in PACKED.rglob("*.so")}
    assert set(libraries) == {
        "hexapod.so",
        "hexapod_controller.so",
        "hexapod_master.so",
        "hexapod_policy.so",
        "libhexapod_c.so",
        "libhexapod_controller_c.so",
    }
    needed = {name: newer_symbols(path.read_bytes()) for name, path in libraries.items()}
    assert [name for name in needed if needed[name]] == []


@pytest.mark.parametrize("fmi", [2, 3])
def test_exported_fmus_need_no_glibc_after_2_14(
    plant_build: Path, tmp_path: Path, fmi: int
) -> None:
    robot = load_robot("athena")
    setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=0.005)
    for fmu in (
        export_fmu(robot, tmp_path / "plant.fmu", fmi=fmi),
        export_controller(setup, tmp_path / "controller.fmu", fmi=fmi),
    ):
        with zipfile.ZipFile(fmu) as archive:
            names = [name for name in archive.namelist() if name.endswith(".so")]
            assert len(names) == 1
            assert newer_symbols(archive.read(names[0])) == []
