"""Tests that the FMU's binaries for all platforms that this machine can run, also under emulators,
repeat a recorded walk bit for bit.

`make test-platforms` installs the emulators and skips nothing.
"""

from __future__ import annotations

import platform
from pathlib import Path
from urllib.parse import quote

import fmpy
import pytest
from fmi_plant import GUID
from platform_walk import (
    EMULATORS,
    EVERYTHING,
    build_walker,
    missing,
    number,
    patient,
    record_walk,
    run_walker,
)

from hexapod_cosim.cosim.export.cross_build import TARGETS, build_library
from hexapod_cosim.cosim.export.export import export_fmu
from hexapod_cosim.cosim.export.platforms import component_library as library_to_build
from hexapod_cosim.models.robot import load_robot


class Walk:
    """A recorded walk, the FMU's resources in a folder with a special name, and the outputs of
    CMake's binary.
    """

    def __init__(self, folder: Path, library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        fmu = export_fmu(load_robot("athena"), folder / "athena.fmu")
        self.inputs = folder / "inputs.txt"
        self.inputs.write_text(record_walk(fmu, monkeypatch), encoding="utf-8")
        self.resources = Path(fmpy.extract(str(fmu), str(folder / "Größe 100% x"))) / "resources"
        self.expected = self.repeat("x86_64-linux", library.read_bytes(), self.resources.as_uri())

    def repeat(self, target: str, data: bytes, resources: str) -> list[str]:
        folder = self.folder / target
        folder.mkdir(exist_ok=True)
        library, program = (
            folder / f"hexapod{TARGETS[target].suffix}",
            folder / ("walker.exe" if "windows" in target else "walker"),
        )
        library.write_bytes(data)
        if not program.exists():
            build_walker(target, folder)
        process = run_walker(target, program, library, GUID, resources, self.inputs)
        assert process.returncode == 0, process.stderr
        return process.stdout.split()


@pytest.fixture(scope="session")
def walk(plant_library: Path, tmp_path_factory: pytest.TempPathFactory) -> Walk:
    with pytest.MonkeyPatch.context() as monkeypatch:
        return Walk(tmp_path_factory.mktemp("walk"), plant_library, monkeypatch)


def runs_here(target: str) -> None:
    """Skips platforms that cannot run on this machine; fails if all are required."""
    if needs := missing(target):
        assert not EVERYTHING, f"{target} cannot run here: {', '.join(needs)} is missing"
        pytest.skip(f"no {', '.join(needs)}: make test-platforms installs it")


def test_the_recorded_walk_moves_the_robot(walk: Walk) -> None:
    steps = [
        list(map(number, walk.expected[k : k + 474])) for k in range(0, len(walk.expected), 474)
    ]
    assert len(steps) == 300
    assert len({tuple(step) for step in steps}) == len(steps)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the reference is of another processor")
@pytest.mark.parametrize("target", EMULATORS)
def test_every_platform_walks_the_same_walk_bit_for_bit(walk: Walk, target: str) -> None:
    runs_here(target)
    patient(target)
    data = build_library(library_to_build(), target)
    resources = f"file:///{EMULATORS[target].drive}{quote(walk.resources.as_posix())}"
    assert walk.repeat(target, data, resources) == walk.expected
