"""The plant has the same bits from every compiler and at every level of optimisation.

HEXAPOD_COMPILERS=all (`make test-compilers`) builds with gcc, clang and zig at -O0 to -O3; without
it one build stands for them. tests/plant/test_plant_lanes.py compares -O0 and all widths of lanes.
"""

from __future__ import annotations

import ctypes as ct
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from plant import Plant
from states import landing, random_command

from hexapod_cosim.models import load_robot

PLANT = Path(__file__).parents[2] / "plant_fmu"
COMPILERS = {"gcc": ["gcc"], "clang": ["clang"], "zig": [sys.executable, "-m", "ziglang", "cc"]}
FEW = [("clang", "-O1")]  # clang shares no optimiser with gcc
ALL = [(name, f"-O{level}") for name in COMPILERS for level in range(4)]
BUILDS = ALL if os.environ.get("HEXAPOD_COMPILERS") == "all" else FEW
STEPS, H = 20, 0.005  # s


def is_there(compiler: str) -> bool:
    if compiler == "zig":
        return importlib.util.find_spec("ziglang") is not None
    return shutil.which(compiler) is not None


def compiled(compiler: str, level: str, folder: Path) -> ct.CDLL:
    """Returns the plant as the build's options make it, but for the level of optimisation, without
    the kernels for other instruction sets.
    """
    file = folder / "plant.so"
    sources = [*sorted((PLANT / "src").rglob("*.c")), PLANT / "generated" / "defaults.c"]
    flags = [
        *("-std=c11", level, "-shared", "-fPIC", "-ffp-contract=off", "-fno-math-errno"),
        *("-fno-trapping-math", "-DHX_SHARED", "-DHX_BASELINE_ONLY", f"-I{PLANT / 'include'}"),
    ]
    command = [*COMPILERS[compiler], *flags, *map(str, sources), "-lm", "-o", str(file)]
    subprocess.run(command, check=True, capture_output=True)
    return ct.CDLL(str(file))


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
