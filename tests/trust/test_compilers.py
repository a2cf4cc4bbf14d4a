"""Tests that equal sources give equal bytes, and that every compiler and level of optimisation
gives the same bits.
"""

from __future__ import annotations

import ctypes as ct
import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from gains import make_gains
from native_controller import NativeController
from plant import Plant
from states import landing, random_command

from hexapod_cosim.controller import BodyCommand, Measurement, Parts, make_gait
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot

PLANT = Path(__file__).parents[2] / "plant_fmu"
CONTROLLER = PLANT.parent / "controller/fmu"
SHARED = ("shared", "message")  # sources of the plant in the controller
COMPILERS = {"gcc": ["gcc"], "clang": ["clang"], "zig": [sys.executable, "-m", "ziglang", "cc"]}
FEW = [("clang", "-O1")]  # clang shares no optimiser with gcc
ALL = [(name, f"-O{level}") for name in COMPILERS for level in range(4)]
BUILDS = ALL if os.environ.get("HEXAPOD_COMPILERS") == "all" else FEW
STEPS, H = 20, 0.005  # s


def is_there(compiler: str) -> bool:
    if compiler == "zig":
        return importlib.util.find_spec("ziglang") is not None
    return shutil.which(compiler) is not None


def built_with(
    compiler: str, level: str, file: Path, sources: list[Path], folders: list[Path]
) -> ct.CDLL:
    """Returns a library as the build's options make it, but for the level of optimisation."""
    flags = [
        *("-std=c11", level, "-shared", "-fPIC", "-ffp-contract=off", "-fno-math-errno"),
        *("-fno-trapping-math", "-DHX_SHARED", "-DHX_BASELINE_ONLY"),
        *(f"-I{folder}" for folder in folders),
    ]
    command = [*COMPILERS[compiler], *flags, *map(str, sources), "-lm", "-o", str(file)]
    subprocess.run(command, check=True, capture_output=True)
    return ct.CDLL(str(file))


def compiled(compiler: str, level: str, folder: Path) -> ct.CDLL:
    """Returns the plant without the kernels for other instruction sets."""
    sources = [*sorted((PLANT / "src").rglob("*.c")), PLANT / "generated" / "defaults.c"]
    return built_with(compiler, level, folder / "plant.so", sources, [PLANT / "include"])


def compiled_controller(compiler: str, level: str, folder: Path) -> ct.CDLL:
    sources = [
        *sorted((CONTROLLER / "src").rglob("*.c")),
        CONTROLLER / "generated" / "defaults.c",
        *(PLANT / "src" / f"{name}.c" for name in SHARED),
    ]
    folders = [CONTROLLER / "include", PLANT / "include"]
    return built_with(compiler, level, folder / "controller.so", sources, folders)


def walk(core: ct.CDLL) -> tuple[bytes, bytes]:
    """Returns state and outputs after a landing and steps under different commands."""
    robot = load_robot("athena")
    plant = Plant(core, robot, **landing(robot))
    for k in range(STEPS):
        command = random_command(robot, k, size=0.2)
        plant.step((k + 1) * H, command)
    return plant.save(), bytes(plant.output_record(command))


@pytest.mark.parametrize(("compiler", "level"), BUILDS)
def test_every_compiler_and_level_gives_the_same_bits(
    core: ct.CDLL, tmp_path: Path, compiler: str, level: str
) -> None:
    if not is_there(compiler):
        pytest.skip(f"no {compiler} is installed")
    (state, output), (expected_state, expected_output) = (
        walk(compiled(compiler, level, tmp_path)),
        walk(core),
    )
    assert state == expected_state
    assert output == expected_output


def control(core: ct.CDLL, law: str) -> list[bytes]:
    """Returns the commands of a controller that turns, leans and feels forces."""
    robot, rng = load_robot("athena"), np.random.default_rng(5)
    setup = ControllerSetup(
        robot=robot,
        gait=make_gait(robot),
        period=H,
        gains=make_gains(robot),
        parts=Parts(),
        law=law,
    )
    controller, found = NativeController(core, setup), []
    body = BodyCommand(vx=0.05, vy=0.02, yaw_rate=0.3, height=0.01, roll=0.05, pitch=-0.04)
    for k in range(10 * STEPS):
        attitude = np.array([1.0, *rng.normal(scale=0.05, size=3)])
        measurement = Measurement(
            angle=robot.stance + rng.normal(scale=0.1, size=(6, 3)),
            foot_force=rng.normal([0.0, 0.0, 10.0], 5.0, size=(6, 3)),
            quaternion=attitude / np.sqrt((attitude * attitude).sum()),
        )
        found.append(bytes(controller.step(k * H, body, measurement)))
    return found


@pytest.mark.parametrize("law", ["compliant", "paper"])
@pytest.mark.parametrize(("compiler", "level"), BUILDS)
def test_every_compiler_and_level_gives_the_same_commands(
    controller_core: ct.CDLL, tmp_path: Path, compiler: str, level: str, law: str
) -> None:
    if not is_there(compiler):
        pytest.skip(f"no {compiler} is installed")
    core = compiled_controller(compiler, level, tmp_path)
    assert control(core, law) == control(controller_core, law)


# Tests that equal sources give equal bytes.

EXPORT = """
import sys
from pathlib import Path
from hexapod_cosim.controller import make_gait
from hexapod_cosim.cosim.export.plant import export_controller
from hexapod_cosim.cosim.export.plant import export_fmu
from hexapod_cosim.cosim.interface.controller import ControllerSetup
from hexapod_cosim.models import load_robot
robot, folder = load_robot("athena"), Path(sys.argv[1])
setup = ControllerSetup(robot=robot, gait=make_gait(robot), period=0.005)
for fmi in (2, 3):
    export_fmu(robot, folder / f"plant{fmi}.fmu", fmi=fmi)
    export_controller(setup, folder / f"controller{fmi}.fmu", fmi=fmi)
"""


def test_two_exports_in_other_processes_zones_and_folders_are_the_same_bytes(
    plant_build: Path, tmp_path: Path
) -> None:
    digests = []
    for number, (seed, place) in enumerate((("1", "UTC"), ("2", "Asia/Tokyo"))):
        folder = tmp_path / f"a folder {number}"
        folder.mkdir()
        environment = os.environ | {"PYTHONHASHSEED": seed, "TZ": place}
        subprocess.run([sys.executable, "-c", EXPORT, str(folder)], env=environment, check=True)
        digests.append(
            {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}
        )
    assert len(digests[0]) == 4
    assert digests[0] == digests[1]
