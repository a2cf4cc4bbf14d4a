"""Tests that a model description offers what its binary has: derivatives with complex numbers."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import zipfile
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from fmi_plant import ATHENA as INTERFACE
from fmi_plant import ERROR, Plant

from hexapod_cosim.cosim.common.plant_files import fmi_headers, source_files
from hexapod_cosim.cosim.export import plant
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models import load_robot

ATHENA = load_robot("athena")
TF = ("true", "false")
BINARY = "binaries/linux64/hexapod.so"


@pytest.fixture(scope="module")
def without_complex(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plant's library as a compiler without complex numbers builds it."""
    compiler = shutil.which("gcc") or shutil.which("clang")
    assert compiler is not None
    folder = tmp_path_factory.mktemp("without_complex")
    for name, source in source_files().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(source.read_bytes())
    sources = [name for name in source_files() if name.endswith(".c")]
    command = [compiler, "-std=c11", "-O0", "-shared", "-fPIC", "-fvisibility=hidden"]
    command += ["-DHX_NO_COMPLEX", "-DHX_BASELINE_ONLY", "-I.", "-I", str(fmi_headers())]
    subprocess.run([*command, *sources, "-o", "hexapod.so", "-lm"], cwd=folder, check=True)
    return folder / "hexapod.so"


def promised(fmu: Path) -> Counter[str]:
    """Returns how many interfaces promise directional derivatives, and how many do not."""
    with zipfile.ZipFile(fmu) as archive:
        text = archive.read("modelDescription.xml").decode()
    found = (text.count(f'providesDirectionalDerivative{s}="{v}"') for s in ("", "s") for v in TF)
    yes2, no2, yes3, no3 = found
    return Counter(yes=yes2 + yes3, no=no2 + no3)


@pytest.mark.parametrize("fmi", [2, 3])
def test_derivatives_are_promised_where_the_binary_has_them(
    plant_library: Path,
    without_complex: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    fmi: int,
) -> None:
    assert promised(export_fmu(ATHENA, tmp_path / "with.fmu", fmi=fmi)) == {"yes": 2, "no": 0}

    def other(*_: Any, **__: Any) -> dict[str, bytes]:
        return {BINARY: without_complex.read_bytes()}

    monkeypatch.setattr(plant, "installed_binary", other)
    assert promised(export_fmu(ATHENA, tmp_path / "less.fmu", fmi=fmi)) == {"yes": 0, "no": 2}


def test_a_binary_without_complex_numbers_refuses_derivatives(without_complex: Path) -> None:
    with Plant(without_complex) as plant:
        plant.initialize()
        reference = (ctypes.c_uint * 1)(0)
        number = (ctypes.c_double * 1)(1.0)
        one = ctypes.c_size_t(1)
        unknown = (ctypes.c_uint * 1)(*INTERFACE.references(["torso.position[3]"]))
        status = plant.call(
            "fmi2GetDirectionalDerivative", unknown, one, reference, one, number, number
        )
        assert status == ERROR
        assert "without complex numbers" in plant.last_message
