"""The built plant: one incremental CMake build a session, in build/test, with the probe of internal functions; the command."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from command import Call
from fmi3_plant import Plant3
from fmi_plant import Plant

from hexapod_cosim.cosim.cli import main

ROOT = Path(__file__).resolve().parents[1]
PRESET = os.environ.get("HEXAPOD_PRESET", "test")  # `make test-sanitize` has another
BUILD = ROOT / "build" / PRESET
PACKED = ROOT / "build" / "plant" if PRESET == "test" else BUILD / "plant"


@pytest.fixture(scope="session")
def plant_build() -> Path:
    """build/test, up to date; also installed to build/plant, from where the exporter packs."""
    if _configure().returncode != 0:
        shutil.rmtree(BUILD, ignore_errors=True)  # configured by a CMake, Python or generator that is gone
        _succeed(_configure())
    _succeed(_cmake("--build", "--preset", PRESET))
    _succeed(_cmake("--install", str(BUILD), "--prefix", str(PACKED)))
    return BUILD


@pytest.fixture(scope="session")
def athena_fmu(plant_build: Path) -> Path:
    """The default robot's FMU as CMake packs it."""
    return plant_build / "athena.fmu"


@pytest.fixture(scope="session")
def plant_library(plant_build: Path) -> Path:
    """The FMU's shared library."""
    return next((plant_build / "plant_fmu").glob("hexapod.[sd]*"))


@pytest.fixture
def plant(plant_library: Path) -> Iterator[Plant]:
    """An FMU instance, not yet initialised."""
    with Plant(plant_library) as instance:
        yield instance


@pytest.fixture
def running(plant: Plant) -> Plant:
    """The same, ready to step."""
    return plant.initialize()


@pytest.fixture
def plant3(plant_library: Path) -> Iterator[Plant3]:
    """An FMI 3.0 co-simulation instance, not yet initialised."""
    with Plant3(plant_library) as instance:
        yield instance


@pytest.fixture
def running3(plant3: Plant3) -> Plant3:
    """The same, ready to step."""
    return plant3.initialize()


@pytest.fixture(scope="session")
def core(plant_build: Path) -> ctypes.CDLL:
    """hexapod.h as a shared library, with the probe's functions."""
    return ctypes.CDLL(str(next((plant_build / "plant_fmu").glob("libhexapod_c.[sd]*"))))


@pytest.fixture(scope="session")
def controller_core(plant_build: Path) -> ctypes.CDLL:
    """controller.h as a shared library."""
    return ctypes.CDLL(str(next((plant_build / "controller_fmu").glob("libhexapod_controller_c.[sd]*"))))


@pytest.fixture
def read_only() -> Iterator[Callable[[Path], None]]:
    """Takes the right to write away from a folder and all in it; gives it back in the end."""
    changed: list[Path] = []

    def protect(folder: Path) -> None:
        for path in [folder, *folder.rglob("*")]:
            changed.append(path)
            path.chmod(path.stat().st_mode & ~0o222)

    yield protect
    for path in changed:
        path.chmod(path.stat().st_mode | 0o200)


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str], plant_build: Path) -> Call:
    """Runs the command in this process: exit code, stdout, stderr."""

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        streams = capsys.readouterr()
        return code, streams.out, streams.err

    return run


def _configure() -> subprocess.CompletedProcess[str]:
    fresh = not (BUILD / "CMakeCache.txt").exists()
    generator = ["-G", "Ninja"] if fresh and shutil.which("ninja", path=_search_path()) else []
    return _cmake("--preset", PRESET, f"-DPython_EXECUTABLE={sys.executable}", *generator)


def _cmake(*arguments: str) -> subprocess.CompletedProcess[str]:
    cmake = shutil.which("cmake", path=_search_path())
    if cmake is None:
        pytest.fail("no cmake: run `pip install -e .[test]`")
    environment = os.environ | {"PATH": _search_path(), "LD_PRELOAD": ""}  # sanitizers are for the tests, not for the build
    return subprocess.run([cmake, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False)


def _search_path() -> str:
    """PATH with the running Python's scripts in front: the environment need not be activated."""
    return os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])


def _succeed(process: subprocess.CompletedProcess[str]) -> None:
    if process.returncode != 0:
        pytest.fail(f"{' '.join(process.args)}\n{process.stdout}\n{process.stderr}", pytrace=False)
