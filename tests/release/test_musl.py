"""The binaries for Linux run on musl, whose loader stands for libc.so.6 and libm.so.6."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from hexapod_cosim.cosim.common.components import CONTROLLER, PLANT, Component
from hexapod_cosim.cosim.export.cross_build import build_library
from hexapod_cosim.cosim.export.platforms import component_library

COMPILER = "musl-gcc"
PROGRAM = r"""
#include <dlfcn.h>
#include <stdio.h>
int main(int count, char **arguments) {
  void *library = dlopen(arguments[count - 1], RTLD_NOW);
  if (!library) {
    puts(dlerror());
    return 1;
  }
  const char *(*version)(void) = (const char *(*)(void))dlsym(library, "fmi2GetVersion");
  puts(version());
  return 0;
}
"""


@pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"needs {COMPILER} (Debian: musl-tools)")
@pytest.mark.parametrize("component", [PLANT, CONTROLLER], ids=lambda one: one.name)
def test_a_program_for_musl_loads_the_binaries_for_linux(
    component: Component, tmp_path: Path
) -> None:
    library = tmp_path / f"{component.identifier}.so"
    library.write_bytes(build_library(component_library(component), "x86_64-linux"))
    source, program = tmp_path / "load.c", tmp_path / "load"
    source.write_text(PROGRAM, encoding="utf-8")
    subprocess.run([COMPILER, "-o", program, source], check=True)
    loaded = subprocess.run([program, library], capture_output=True, text=True, check=False)
    assert (loaded.returncode, loaded.stdout) == (0, "2.0\n")
