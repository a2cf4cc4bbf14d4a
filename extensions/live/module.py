"""Builds the WebAssembly module of the default robot with its controller (wasm/walker.h)."""

from __future__ import annotations

from pathlib import Path

from hexapod_cosim.cosim.common.plant_files import in_source_tree, plant_folders
from hexapod_cosim.cosim.export.cross_build import BROWSER, Library, build_library
from hexapod_cosim.models import HexapodError

NAME = "walker"
CONTROLLER_ROBOT = "controller/fmu/generated/defaults.c"  # see wasm/controller_defaults.c
WASM = "extensions/live/wasm"
OWN_FILES = ("controller_defaults.c", "walker.c", "walker.h")
_TREE = Path(__file__).resolve().parents[2]


def walker_module() -> bytes:
    """Returns the module: that of a released wheel, or one that is compiled, or from the cache.

    Raises HexapodError in a wheel that was built for one machine, and FmuError without a cross
    compiler.
    """
    if in_source_tree():
        return build_library(walker_library(), BROWSER)
    for folder in plant_folders():
        path = folder / "browser" / f"{NAME}.wasm"
        if path.is_file():
            return path.read_bytes()
    raise HexapodError(
        "no WebAssembly module in this installation",
        got="a wheel that was built for one machine",
        expected="a clone, or a wheel of `make wheels`",
        fix="install one of these",
    )


def walker_library() -> Library:
    """Returns the sources of the module by their paths in the repository.

    Public headers are at their path in the include folder.
    """
    found: dict[str, Path] = {}
    for component in ("plant_fmu", "controller/fmu"):
        folder = _TREE / component
        for path in (folder / "src").rglob("*.[ch]"):
            found[path.relative_to(_TREE).as_posix()] = path
        for path in (folder / "include" / "hexapod").glob("*.h"):
            found[f"hexapod/{path.name}"] = path
        found[f"{component}/generated/defaults.c"] = folder / "generated" / "defaults.c"
    found |= {f"{WASM}/{name}": _TREE / WASM / name for name in OWN_FILES}
    return Library(
        NAME, dict(sorted(found.items())), flags=("-DHX_SHARED",), included=(CONTROLLER_ROBOT,)
    )
