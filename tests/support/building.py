"""The plant built for tests: one incremental CMake build in build/test, also installed to where
the exporter packs from.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from filelock import FileLock

ROOT = Path(__file__).resolve().parents[2]
PRESET = os.environ.get("HEXAPOD_PRESET", "test")  # `make test-sanitize` has another
BUILD = ROOT / "build" / PRESET
PACKED = ROOT / "build" / "plant" if PRESET == "test" else BUILD / "plant"


class BuildError(Exception):
    """What CMake or the compiler said."""


def built() -> Path:
    """build/test, up to date; also installed to build/plant. Of the processes of one test run
    the first builds. Raises BuildError.
    """
    BUILD.parent.mkdir(exist_ok=True)
    session, last = (
        os.environ.get("PYTEST_XDIST_TESTRUNUID", ""),
        BUILD.parent / f".{PRESET}.session",
    )
    with FileLock(BUILD.parent / f".{PRESET}.lock"):
        if not session or not last.exists() or last.read_text(encoding="utf-8") != session:
            _build()
            last.write_text(session, encoding="utf-8")
    return BUILD


def _build() -> None:
    if _configure().returncode != 0:
        shutil.rmtree(
            BUILD, ignore_errors=True
        )  # configured by a CMake, Python or generator that is gone
        _succeed(_configure())
    _succeed(_cmake("--build", "--preset", PRESET))
    _succeed(_cmake("--install", str(BUILD), "--prefix", str(PACKED)))


def shared_library(build: Path, component: str, name: str) -> Path:
    """A shared library of a component's folder in the build, whatever this system ends its name
    with.
    """
    return next((build / component).glob(f"{name}.[sd]*"))


def _configure() -> subprocess.CompletedProcess[str]:
    fresh = not (BUILD / "CMakeCache.txt").exists()
    generator = ["-G", "Ninja"] if fresh and shutil.which("ninja", path=_search_path()) else []
    return _cmake("--preset", PRESET, f"-DPython_EXECUTABLE={sys.executable}", *generator)


def _cmake(*arguments: str) -> subprocess.CompletedProcess[str]:
    cmake = shutil.which("cmake", path=_search_path())
    if cmake is None:
        raise BuildError("no cmake: run `pip install -e .[test]`")
    environment = os.environ | {
        "PATH": _search_path(),
        "LD_PRELOAD": "",
    }  # sanitizers are for the tests, not for the build
    return subprocess.run(
        [cmake, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )


def _search_path() -> str:
    """PATH with the running Python's scripts in front: the environment need not be activated."""
    return os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])


def _succeed(process: subprocess.CompletedProcess[str]) -> None:
    if process.returncode != 0:
        raise BuildError(f"{' '.join(process.args)}\n{process.stdout}\n{process.stderr}")
