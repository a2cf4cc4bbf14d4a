"""The plant stays within its arrays under every choice of a definition.

The native test of all choices (tests/native/test_choices.c) is built with the address sanitizer and
checks of all indices. `make test-sanitize-short` runs more tests with more checks.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLANT, NATIVE = ROOT / "plant_fmu", ROOT / "tests" / "native"
GRIDS = ROOT / "tests" / "fuzz" / "seeds" / "fuzz_grid"
FLAGS = ("-std=c11", "-Og", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
CHECKS = ("-fsanitize=address,bounds", "-fno-sanitize-recover=all")


def build(program: Path, *sources: Path) -> None:
    """Builds a program of the plant's sources and others, with the baseline kernel alone."""
    includes = (f"-I{PLANT / 'include'}", f"-I{NATIVE}")
    plant = [*sorted((PLANT / "src").rglob("*.c")), PLANT / "generated" / "defaults.c"]
    command = ["gcc", *FLAGS, *CHECKS, "-DHX_BASELINE_ONLY", *includes, "-o", str(program)]
    subprocess.run([*command, *map(str, (*plant, *sources)), "-lm"], check=True)


def has_sanitizers(folder: Path) -> bool:
    """Returns whether gcc and its sanitizers are installed."""
    source = folder / "nothing.c"
    source.write_text("int main(void) { return 0; }\n", encoding="utf-8")
    command = ["gcc", *CHECKS, str(source), "-o", str(folder / "nothing")]
    return shutil.which("gcc") is not None and subprocess.run(command, check=False).returncode == 0


def test_every_choice_of_a_definition_stays_within_its_arrays(tmp_path: Path) -> None:
    if not has_sanitizers(tmp_path):
        pytest.skip("gcc or its sanitizers are not installed")
    program = tmp_path / "test_choices"
    build(program, NATIVE / "test_choices.c")
    done = subprocess.run([program, GRIDS], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
