"""Runs the native test of every choice that a definition offers (tests/native/test_choices.c)."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

GRIDS = Path(__file__).resolve().parents[1] / "fuzz" / "seeds" / "fuzz_grid"


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
