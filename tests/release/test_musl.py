"""The binaries for Linux run on musl, whose loader stands for libc.so.6 and libm.so.6."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from hexapod_cosim.cosim.export.cross_build import Library, build_library
from hexapod_cosim.cosim.export.platforms import component_library

wheels = pytest.importorskip("tools.wheels", reason="needs the extra release")

COMPILER = "musl-gcc"
LIBRARIES = [
    *((component_library(one), "fmi2GetVersion") for one in wheels.components()),
    (wheels.loop_library(), "hx_master_layout"),
]
PROGRAM = r"""
#include <dlfcn.h>
#include <stdio.h>
int main(int count, char **arguments) {
  void *library = dlopen(arguments[count - 2], RTLD_NOW);
  if (!library) {
    puts(dlerror());
    return 1;
  }
  return dlsym(library, arguments[count - 1]) ? 0 : 2;
}
"""


@pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"needs {COMPILER} (Debian: musl-tools)")
@pytest.mark.parametrize(("source_of", "function"), LIBRARIES, ids=lambda one: str(one)[:8])
def test_a_program_for_musl_loads_the_binaries_for_linux(
    source_of: Library, function: str, tmp_path: Path
) -> None:
    library = tmp_path / "library.so"
    library.write_bytes(build_library(source_of, "x86_64-linux"))
    source, program = tmp_path / "load.c", tmp_path / "load"
    source.write_text(PROGRAM, encoding="utf-8")
    subprocess.run([COMPILER, "-o", program, source], check=True)
    command = [str(program), str(library), function]
    loaded = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (loaded.returncode, loaded.stdout) == (0, "")
