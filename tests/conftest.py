"""The built plant: one incremental CMake build a session, in build/test, with the probe of
internal functions; the command.
"""

from __future__ import annotations

import os

# Threads of OpenBLAS wait by spinning: beside other processes, small matrices then take ten times
# as long. OpenBLAS reads the variable when NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import ctypes
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from building import PACKED, BuildError, built, shared_library
from command import QUICK, Call
from fmi3_plant import Plant3
from fmi_plant import Plant
from xdist.scheduler import LoadScopeScheduling

from hexapod_cosim.cosim.cli import main
from hexapod_cosim.cosim.common import plant_files
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.models import load_robot

# A shell that runs the tests in the background lets them ignore Ctrl-C, and their children too.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# what takes longest begins, so that no process is left with it in the end
LONGEST = (
    "test_docs",
    "test_native_walks",
    "test_native_faults",
    "test_platforms",
    "test_platform_walks",
    "test_cli",
    "test_study_cluster",
    "test_typed_commands",
    "test_live_browser",
    "test_twin_motion",
    "test_every_terrain",
    "test_accuracy",
    "test_batch",
    "test_side_by_side",
    "test_study_workers",
    "test_random_robots",
    "test_browser",
    "test_cli_endings",
    "test_controller_continuity",
    "test_study_store",
    "test_identify",
    "test_export",
    "test_fmi3_archive",
    "test_plant_lanes",
)
# what builds the same binaries for other platforms stays together
TOGETHER = dict.fromkeys(("test_platforms", "test_platform_walks", "test_cross_build"), "platforms")


class Files(LoadScopeScheduling):  # type: ignore[misc]
    """A file's tests, with their fixtures, stay in one process. (Groups by marks do nothing
    under pytest 9.2 with xdist 3.8.)
    """

    def _split_scope(self, nodeid: str) -> str:
        stem = Path(nodeid.partition("::")[0]).stem
        return TOGETHER.get(stem, stem)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Files:
    """Of several processes (`make test`)."""
    return Files(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order for several processes; in one everything is as it was."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(
            key=lambda item: (
                LONGEST.index(item.path.stem) if item.path.stem in LONGEST else len(LONGEST)
            )
        )


@pytest.fixture(scope="session")
def plant_build() -> Path:
    """build/test, up to date; also installed to build/plant, from where the exporter packs. Of
    several processes one builds.
    """
    try:
        return built()
    except BuildError as error:
        pytest.fail(str(error), pytrace=False)


@pytest.fixture(scope="session")
def athena_fmu(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The default robot's FMU with the binary of this build, which may have sanitizers."""
    path = tmp_path_factory.mktemp("athena") / "athena.fmu"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plant_files, "plant_folders", lambda: [PACKED])
        return export_fmu(load_robot("athena"), path)


@pytest.fixture(scope="session")
def plant_library(plant_build: Path) -> Path:
    """The FMU's shared library."""
    return shared_library(plant_build, "plant_fmu", "hexapod")


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
    return ctypes.CDLL(str(shared_library(plant_build, "plant_fmu", "libhexapod_c")))


@pytest.fixture(scope="session")
def controller_core(plant_build: Path) -> ctypes.CDLL:
    """controller.h as a shared library."""
    return ctypes.CDLL(
        str(shared_library(plant_build, "controller/fmu", "libhexapod_controller_c"))
    )


@pytest.fixture(scope="session")
def recorded(plant_build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of a short walk under kinematic control, as MCAP and Parquet."""
    folder = tmp_path_factory.mktemp("walked") / "out"
    formats = ("--format", "mcap", "--format", "parquet")
    assert main(["simulate", "walk_flat", "-o", str(folder), *formats, *QUICK]) == 0
    return folder


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
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports that this process writes have no figures, which take seconds to draw."""
    monkeypatch.setattr("hexapod_cosim.cosim.report.plots.DRAWINGS", {})


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str], plant_build: Path) -> Call:
    """Runs the command in this process: exit code, stdout, stderr."""

    def run(*arguments: str | Path) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        streams = capsys.readouterr()
        return code, streams.out, streams.err

    return run
