"""Tests that the FMU's binaries for all platforms that this machine can run, also under emulators,
repeat a recorded walk bit for bit: on the plane, on a height field, on blocks and in soil.

`make test-platforms` installs the emulators and skips nothing.
"""

from __future__ import annotations

import platform
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

import fmpy
import pytest
from platform_walk import (
    EMULATORS,
    EVERYTHING,
    build_repeater,
    missing,
    number,
    patient,
    record_walk,
    run_repeater,
)

from hexapod_cosim.cosim.export.cross_build import TARGETS, build_library
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.export.platforms import component_library as library_to_build
from hexapod_cosim.models import Robot, load_robot
from hexapod_cosim.models.ground.table import read_terrain

OUTPUTS = 584
STEPS, SHORT = 300, 150  # of the walk on the plane and of the others


def on_ground(name: str) -> Robot:
    """Returns the robot on the plane, a height field, blocks, or soil with footprints."""
    robot = load_robot("athena")
    if name == "plane":
        return robot
    if name == "soil":
        robot = replace(robot, foot=replace(robot.foot, pad_radius=0.025))
        return replace(robot, terrain=read_terrain({"kind": "sand"}, name))
    kind = {"height field": "wave", "blocks": "rubble"}[name]
    return replace(robot, terrain=read_terrain({"kind": kind, "platform_size": 0.0}, name))


class RecordedRun:
    """The FMU's resources in a folder with a special name, the inputs of a recorded walk, and the
    outputs of CMake's binary.
    """

    def __init__(self, folder: Path, library: Path, robot: Robot, inputs: str) -> None:
        self.folder = folder
        fmu = export_fmu(robot, folder / "robot.fmu")
        self.inputs = folder / "inputs.txt"
        self.inputs.write_text(inputs, encoding="utf-8")
        self.guid = str(fmpy.read_model_description(str(fmu)).guid)
        self.resources = Path(fmpy.extract(str(fmu), str(folder / "Größe 100% x"))) / "resources"
        self.expected = self.repeat("x86_64-linux", library.read_bytes(), self.resources.as_uri())

    @property
    def steps(self) -> list[list[float]]:
        """The outputs of each step."""
        words = self.expected
        return [list(map(number, words[k : k + OUTPUTS])) for k in range(0, len(words), OUTPUTS)]

    def repeat(self, target: str, data: bytes, resources: str) -> list[str]:
        folder = self.folder / target
        folder.mkdir(exist_ok=True)
        library, program = (
            folder / f"hexapod{TARGETS[target].suffix}",
            folder / ("repeater.exe" if "windows" in target else "repeater"),
        )
        library.write_bytes(data)
        if not program.exists():
            build_repeater(target, folder)
        process = run_repeater(target, program, library, self.guid, resources, self.inputs)
        assert process.returncode == 0, process.stderr
        return process.stdout.split()


@pytest.fixture(scope="session")
def recorded(plant_library: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Returns the inputs of a walk, which do not depend on the ground."""
    fmu = export_fmu(load_robot("athena"), tmp_path_factory.mktemp("recorded") / "athena.fmu")
    with pytest.MonkeyPatch.context() as monkeypatch:
        return record_walk(fmu, monkeypatch)


@pytest.fixture(scope="session", params=["plane", "height field", "blocks", "soil"])
def walk(
    request: pytest.FixtureRequest,
    recorded: str,
    plant_library: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> RecordedRun:
    inputs = recorded if request.param == "plane" else first_steps(recorded, SHORT)
    folder = tmp_path_factory.mktemp("walk")
    return RecordedRun(folder, plant_library, on_ground(request.param), inputs)


def first_steps(inputs: str, steps: int) -> str:
    """Returns recorded inputs with their first steps alone."""
    references_in, references_out, size, *rows = inputs.splitlines()
    lines = [references_in, references_out, f"{steps} {size.split()[1]}", *rows[:steps]]
    return "\n".join(lines) + "\n"


def runs_here(target: str) -> None:
    """Skips platforms that cannot run on this machine; fails if all are required."""
    if needs := missing(target):
        assert not EVERYTHING, f"{target} cannot run here: {', '.join(needs)} is missing"
        pytest.skip(f"no {', '.join(needs)}: make test-platforms installs it")


def test_the_recorded_walk_moves_the_robot(walk: RecordedRun) -> None:
    steps = walk.steps
    assert len(steps) in (STEPS, SHORT)
    assert len({tuple(step) for step in steps}) == len(steps)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the reference is of another processor")
@pytest.mark.parametrize("target", EMULATORS)
def test_every_platform_walks_the_same_walk_bit_for_bit(walk: RecordedRun, target: str) -> None:
    runs_here(target)
    patient(target)
    data = build_library(library_to_build(), target)
    resources = f"file:///{EMULATORS[target].drive}{quote(walk.resources.as_posix())}"
    assert walk.repeat(target, data, resources) == walk.expected
