"""Tests the wheels for all platforms: files, tags, order and times, and that
the binaries for Linux run on musl.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

from hexapod_cosim.cosim.export.cross_build import Library, build_library
from hexapod_cosim.cosim.export.platforms import component_library

wheels = pytest.importorskip("tools.wheels", reason="needs the extra release")

BASE = {
    "hexapod_cosim/__init__.py": b"",
    "hexapod_cosim-0.1.0.dist-info/METADATA": b"Metadata-Version: 2.2\nName: hexapod-cosim\n",
    "hexapod_cosim-0.1.0.dist-info/WHEEL": (
        b"Wheel-Version: 1.0\nGenerator: scikit-build-core\nRoot-Is-Purelib: false\n"
        b"Tag: py3-none-linux_x86_64\n\n"
    ),
}
BINARIES = {
    ("hexapod", "x86_64-linux"): b"plant for Linux",
    ("hexapod", "x86_64-windows"): b"plant for Windows",
    ("hexapod_master", "x86_64-linux"): b"loop for Linux",
    ("hexapod_master", "x86_64-windows"): b"loop for Windows",
}
WINDOWS = "hexapod_cosim-0.1.0-py3-none-win_amd64.whl"


@pytest.fixture
def windows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A wheel for Windows with texts instead of binaries."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    platform = wheels.Platform("x86_64-windows", "win_amd64")
    path: Path = wheels.write_wheel(BASE, platform, BINARIES, tmp_path)
    return path


def test_a_wheel_has_the_binaries_of_all_platforms_and_its_own_loop(windows: Path) -> None:
    assert windows.name == WINDOWS
    with zipfile.ZipFile(windows) as archive:
        assert {name for name in archive.namelist() if "/plant/" in name} == {
            "hexapod_cosim/plant/binaries/x86_64-linux/hexapod.so",
            "hexapod_cosim/plant/binaries/x86_64-windows/hexapod.dll",
            "hexapod_cosim/plant/lib/hexapod_master.dll",
        }
        assert archive.read("hexapod_cosim/plant/lib/hexapod_master.dll") == b"loop for Windows"


def test_a_wheel_lists_its_files_last_and_has_one_time(windows: Path) -> None:
    with zipfile.ZipFile(windows) as archive:
        assert archive.namelist()[-1] == "hexapod_cosim-0.1.0.dist-info/RECORD"
        assert {member.date_time for member in archive.infolist()} == {(2023, 11, 14, 22, 13, 20)}
        record = archive.read("hexapod_cosim-0.1.0.dist-info/RECORD").decode()
    assert record.count("sha256=") == 6


def test_a_wheel_for_linux_has_the_tags_of_both_c_libraries() -> None:
    text = wheels.wheel_description(
        BASE["hexapod_cosim-0.1.0.dist-info/WHEEL"], wheels.PLATFORMS[0].tag
    )
    assert text.decode().splitlines() == [
        "Wheel-Version: 1.0",
        "Generator: scikit-build-core",
        "Root-Is-Purelib: false",
        "Tag: py3-none-manylinux_2_17_x86_64",
        "Tag: py3-none-manylinux2014_x86_64",
        "Tag: py3-none-musllinux_1_1_x86_64",
    ]


def test_a_wheel_lists_the_foreign_software_in_it() -> None:
    ((name, text),) = wheels.bill_of_materials(BASE).items()
    assert name == "hexapod_cosim-0.1.0.dist-info/sboms/bundled.cdx.json"
    found = {part["name"] for part in json.loads(text)["components"]}
    assert found == {"three", "uplot", "fmpy"}


def test_the_list_of_hashes_is_what_sha256sum_reads(tmp_path: Path) -> None:
    (tmp_path / "a.whl").write_bytes(b"abc")
    path = wheels.write_hashes(tmp_path, [tmp_path / "a.whl"])
    assert path.name == "SHA256SUMS"
    assert path.read_text(encoding="utf-8") == (
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  a.whl\n"
    )


# The binaries for Linux run on musl, whose loader stands for libc.so.6 and libm.so.6.

COMPILER = "musl-gcc"
LIBRARIES = [
    *((component_library(one), "fmi2GetVersion") for one in wheels.components()),
    *((library, "hx_master_layout") for library in wheels.loop_libraries()),
]
PROGRAM = r"""
#include <dlfcn.h>
#include <stdio.h>
int main(int count, char **arguments) {
  void *library = dlopen(arguments[count - 2], RTLD_NOW);
  if (!library) {
    puts(dlerror());
    return 1;
  }
  return dlsym(library, arguments[count - 1]) ? 0 : 2;
}
"""


@pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"needs {COMPILER} (Debian: musl-tools)")
@pytest.mark.parametrize(("source_of", "function"), LIBRARIES, ids=lambda one: str(one)[:8])
def test_a_program_for_musl_loads_the_binaries_for_linux(
    source_of: Library, function: str, tmp_path: Path
) -> None:
    library = tmp_path / "library.so"
    library.write_bytes(build_library(source_of, "x86_64-linux"))
    source, program = tmp_path / "load.c", tmp_path / "load"
    source.write_text(PROGRAM, encoding="utf-8")
    subprocess.run([COMPILER, "-o", program, source], check=True)
    command = [str(program), str(library), function]
    loaded = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (loaded.returncode, loaded.stdout) == (0, "")
