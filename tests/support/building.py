"""Builds the plant for tests.

One incremental CMake build in build/test is installed to build/plant, where the exporter finds it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from filelock import FileLock

ROOT = Path(__file__).resolve().parents[2]
PRESET = os.environ.get(
    "HEXAPOD_PRESET", "test"
)  # of tools/cmake; `make test-sanitize` uses another folder
BUILD = ROOT / "build" / PRESET
TARGETS = ["hexapod", "hexapod_c", "hexapod_controller", "hexapod_controller_c", "hexapod_master"]
if (ROOT / "extensions" / "gym").is_dir():
    TARGETS += ["hexapod_policy", "hexapod_gym"]
PACKED = ROOT / "build" / "plant" if PRESET == "test" else BUILD / "plant"


class BuildError(Exception):
    """The build failed; the message is that of CMake or the compiler."""


def built() -> Path:
    """Builds build/test, installs it to build/plant and returns its folder.

    In a test run of several processes the first one builds. Raises BuildError.
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
        # CMake, Python or the generator of the build folder is missing
        shutil.rmtree(BUILD, ignore_errors=True)
        _succeed(_configure())
    _succeed(_cmake("--build", str(BUILD), "--target", *TARGETS))
    _succeed(_cmake("--install", str(BUILD), "--prefix", str(PACKED)))


def shared_library(build: Path, component: str, name: str) -> Path:
    """Returns a shared library of a component's folder in the build, whatever its suffix on this
    system.
    """
    return next((build / component).glob(f"{name}.[sd]*"))


def _configure() -> subprocess.CompletedProcess[str]:
    fresh = not (BUILD / "CMakeCache.txt").exists()
    generator = ["-G", "Ninja"] if fresh and shutil.which("ninja", path=_search_path()) else []
    settings = str(ROOT / "tools" / "cmake" / f"{PRESET}.cmake")
    where = ["-S", str(ROOT / "packaging"), "-B", str(BUILD), "-C", settings]
    return _cmake(*where, f"-DPython_EXECUTABLE={sys.executable}", *generator)


def _cmake(*arguments: str) -> subprocess.CompletedProcess[str]:
    cmake = shutil.which("cmake", path=_search_path())
    if cmake is None:
        raise BuildError("no cmake: run `pip install -e .[test]`")
    environment = os.environ | {
        "PATH": _search_path(),
        "LD_PRELOAD": "",
    }  # sanitizers are used in the tests' own build only
    return subprocess.run(
        [cmake, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )


def _search_path() -> str:
    """Returns PATH with the running Python's scripts first, so that the environment need not be
    active.
    """
    return os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])


def _succeed(process: subprocess.CompletedProcess[str]) -> None:
    if process.returncode != 0:
        raise BuildError(f"{' '.join(process.args)}\n{process.stdout}\n{process.stderr}")
