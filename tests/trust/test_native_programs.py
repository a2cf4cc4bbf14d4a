"""Runs programs of tests/native: every choice that a definition offers, and the stack that calls
of released binaries take.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common.components import CONTROLLER, PLANT, Component
from hexapod_cosim.cosim.common.plant_files import fmi_headers
from hexapod_cosim.cosim.export.cross_build import build_library
from hexapod_cosim.cosim.export.platforms import component_library

ROOT = Path(__file__).parents[2]
GRIDS = ROOT / "tests" / "native" / "grids"


def test_every_choice_of_a_definition_keeps_the_laws_or_is_refused_by_name(
    plant_build: Path,
) -> None:
    search = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    cmake = shutil.which("cmake", path=search)
    assert cmake is not None
    command = [cmake, "--build", str(plant_build), "--target", "test_choices"]
    built = subprocess.run(
        command, capture_output=True, text=True, check=False, env=os.environ | {"PATH": search}
    )
    assert built.returncode == 0, built.stdout + built.stderr
    program = plant_build / "tests" / "native" / "test_choices"
    done = subprocess.run([program, GRIDS], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# The stack that calls of the cross-compiled binaries take, which are those of a release: zig
# inlines other functions than the compiler of this machine, with which tests/native are built.


@pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64",
    reason="the program that measures is for Linux on x86-64",
)
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("component", [PLANT, CONTROLLER], ids=["plant", "controller"])
def test_no_call_of_a_released_binary_takes_more_than_48_kb_of_stack(
    plant_build: Path, component: Component, tmp_path: Path
) -> None:
    library, program = tmp_path / "library.so", tmp_path / "measure"
    library.write_bytes(build_library(component_library(component), "x86_64-linux"))
    source = ROOT / "tests" / "native" / "test_stack_fmi.c"
    options = [f"-I{fmi_headers()}", f"-Wl,-rpath,{tmp_path}", "-lpthread", "-lm"]
    subprocess.run(["cc", "-o", program, source, library, *options], check=True)
    description = plant_build / "descriptions" / component.name / "modelDescription.xml"
    done = subprocess.run([program, description], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "FMI 2.0: inputs, step" in done.stdout
