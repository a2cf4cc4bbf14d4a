"""Writes the sources of the FMUs that the repository does not have, before they are compiled:
generated/variables.h and variables.c of each FMU, and defaults.c of the extensions' FMUs.

usage: python tools/generate_sources.py FOLDER     (called by plant_fmu/CMakeLists.txt)

modelDescription.xml and start_values.txt of plant and controller, which tests in C read, are
written into FOLDER/plant and FOLDER/controller. The program imports the code of this repository,
whether or not the package is installed, and needs numpy alone.
"""

from __future__ import annotations

import sys
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[1]
COMMITTED = (
    *("plant_fmu/generated/defaults.c", "controller/fmu/generated/defaults.c"),
    "plant_fmu/include/hexapod/generated/plant_settings.h",
    "controller/fmu/include/hexapod/generated/controller_settings.h",
)


def import_from(folder: Path) -> None:
    """Makes a folder the package hexapod_cosim."""
    sys.meta_path.insert(0, PathFinder)  # before the finder of an editable installation
    package = ModuleType("hexapod_cosim")
    package.__path__ = [str(folder)]
    sys.modules["hexapod_cosim"] = package


def main(folder: Path) -> None:
    """Writes the files that are missing or not up to date."""
    import_from(ROOT)
    import generate  # noqa: PLC0415  beside this file

    committed = {ROOT / name for name in COMMITTED}
    files = generate.render_all() | generate.descriptions(folder)
    for path, text in generate.stale_files(files).items():
        if path not in committed:
            generate.write(path, text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
