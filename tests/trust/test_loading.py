"""Tests where and how the binaries run: beside others in one process, under any locale, on Linux
systems with an old glibc.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import lief
import pytest
from building import PACKED, TARGETS, shared_library

from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export.plant import export_controller, export_fmu
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot

NEEDS_LOADING = pytest.mark.skipif(sys.platform != "linux", reason="RTLD_GLOBAL is of ELF systems")

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


@NEEDS_LOADING
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


@NEEDS_LOADING
@pytest.mark.parametrize("component", range(2))
def test_no_library_looks_for_its_own_functions_elsewhere(both: list[Path], component: int) -> None:
    library: Any = lief.parse(str(both[component]))
    exported = {symbol.name for symbol in library.exported_symbols}
    looked_up = {place.symbol.name for place in library.relocations if place.has_symbol}
    assert "fmi2FreeInstance" in exported
    assert looked_up & exported == set()


# Tests that messages and results do not depend on the locale that a process has set.

NEEDS_LOCALE = pytest.mark.skipif(sys.platform != "linux", reason="the locale's file is glibc's")

MAGIC = 0x20031115  # of glibc's files of most categories of a locale
NUMERIC = 1  # number of the category LC_NUMERIC

# sets the locale and prints the messages of refused calls to the plant and to its core
REFUSED = """
import ctypes, locale, sys
locale.setlocale(locale.LC_NUMERIC, "comma")
libc = ctypes.CDLL(None)
text = ctypes.create_string_buffer(32)
libc.snprintf(text, ctypes.c_size_t(32), b"%g", ctypes.c_double(1.5))
print(text.value.decode())
from pathlib import Path
from fmi_plant import Plant
with Plant(Path(sys.argv[1])) as plant:
    plant.set_reals({"foot.radius": -1.5})
    print(plant.last_message)
    plant.initialize(start=0.5)
    plant.step(0.25, 0.125)
    print(plant.last_message)
    plant.step(0.5, 0.125)
    print(plant.real("torso.position[3]").hex())
"""


def numeric_category(point: bytes) -> bytes:
    """Returns the file LC_NUMERIC of a locale with this sign for the decimal point.

    Its fields are the sign, the separator and the grouping of thousands, both signs as numbers, and
    the encoding.
    """
    code = ord(point.decode()).to_bytes(4, "little")
    fields = [point + b"\0", b"\0", b"\0", code, bytes(4), b"UTF-8\0"]
    head = 8 + 4 * len(fields)
    places, body = [], b""
    for field in fields:
        if len(field) == 4 and field in (code, bytes(4)):
            body += bytes(-(head + len(body)) % 4)
        places.append(head + len(body))
        body += field
    numbers = [MAGIC ^ NUMERIC, len(fields), *places]
    return b"".join(number.to_bytes(4, "little") for number in numbers) + body


def said(folder: Path, library: Path, point: str) -> list[str]:
    """Returns what the program prints in a locale with this sign for the decimal point."""
    (folder / "comma").mkdir()
    (folder / "comma" / "LC_NUMERIC").write_bytes(numeric_category(point.encode()))
    support = Path(__file__).resolve().parents[1] / "support"
    environment = os.environ | {"LOCPATH": str(folder), "PYTHONPATH": str(support)}
    done = subprocess.run(
        [sys.executable, "-c", REFUSED, str(library)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()


@NEEDS_LOCALE
@pytest.mark.parametrize("point", [",", "\N{ARABIC DECIMAL SEPARATOR}"])
def test_messages_and_results_are_those_of_a_decimal_point(
    tmp_path: Path, plant_library: Path, point: str
) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "plain").mkdir()
    number, *lines = said(tmp_path / "other", plant_library, point)
    assert number == f"1{point}5"  # the locale is in force
    assert ": got -1.5, expected a finite number in [" in lines[0]
    assert lines[1].startswith("communication point: got 0.25 s, expected 0.5, ")
    assert lines == said(tmp_path / "plain", plant_library, ".")[1:]


# Tests on which Linux systems the binaries run: the newest version of glibc that they ask for.

NEWEST = (2, 14)  # of x86-64, where memcpy got its present version

NEEDS_SYMBOL_VERSIONS = pytest.mark.skipif(
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


@NEEDS_SYMBOL_VERSIONS
def test_installed_libraries_need_no_glibc_after_2_14(plant_build: Path) -> None:
    libraries = {path.name: path for path in PACKED.rglob("*.so")}
    has_gym = "hexapod_policy" in TARGETS  # an extension may have been deleted
    assert set(libraries) == {
        "hexapod.so",
        "hexapod_controller.so",
        "hexapod_master.so",
        *(["hexapod_policy.so", "hexapod_gym.so"] if has_gym else []),
        "libhexapod_c.so",
        "libhexapod_controller_c.so",
    }
    needed = {name: newer_symbols(path.read_bytes()) for name, path in libraries.items()}
    assert [name for name in needed if needed[name]] == []


@NEEDS_SYMBOL_VERSIONS
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
