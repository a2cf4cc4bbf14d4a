"""Locations of a component's binaries, sources and interface.toml, in a source tree or in an
installed wheel.
"""

from __future__ import annotations

import hashlib
import platform
import sys
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import metadata, util
from pathlib import Path

from hexapod_cosim.cosim.common.components import PLANT, Component
from hexapod_cosim.models.errors import FmuError

DISTRIBUTION = "hexapod-cosim"
GENERATED_SOURCES = ("variables.h", "variables.c", "defaults.c")
# files of the plant that every component contains
SHARED_SOURCES = ("shared.c", "message.c")
SHARED_HEADERS = (
    *("status.h", "legs.h", "inside.h", "range_check.h", "message.h"),
    "shared_work.h",
)
LOOP = "hexapod_master"  # the shared library of the co-simulation loop
# each needs the headers of its version of the standard only
FMI2_SOURCES, FMI3_SOURCES = "fmi/fmi2", "fmi/fmi3"  # beginnings of the names
BUILD = "run `pip install -e .` in the source tree, or `pip install .` (both need a C compiler)"
# values of platform.machine() in lower case
X86 = {"x86_64", "amd64", "i386", "i486", "i586", "i686", "x86"}

_COSIM = Path(__file__).resolve().parents[1]
_PLANT_TREE = _COSIM.parent / "plant_fmu"
_INSTALLED = _COSIM.parent / "plant"


def in_source_tree() -> bool:
    """Returns whether this package runs from a source tree: an editable install, or build/typing
    on the path.
    """
    return (_PLANT_TREE / "interface.toml").is_file()


def interface_file(component: Component = PLANT) -> Path:
    """Returns the path of a component's interface.toml."""
    return (
        _COSIM.parent
        / (component.tree if in_source_tree() else component.installed)
        / "interface.toml"
    )


def package_version() -> str:
    """Returns the package's version.

    In a source tree it is read from pyproject.toml, since the metadata of an editable install may
    be older.
    """
    if in_source_tree():
        project = tomllib.loads(
            (_PLANT_TREE.parent / "pyproject.toml").read_text(encoding="utf-8")
        )["project"]
        return str(project["version"])
    return metadata.version(DISTRIBUTION)


@cache
def code_hash() -> str:
    """Returns 16 hexadecimal digits that identify this package's code: its Python files, robots
    and co-simulation loop.
    """
    digest = hashlib.sha256()
    for folder in (
        _COSIM.parent / name for name in ("cosim", "controller", "models", "extensions")
    ):
        for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.toml")]):
            digest.update(
                path.relative_to(_COSIM.parent).as_posix().encode()
                + hashlib.sha256(path.read_bytes()).digest()
            )
    digest.update(shared_library(LOOP).read_bytes())
    return digest.hexdigest()[:16]


def source_files(component: Component = PLANT) -> dict[str, Path]:
    """Returns a component's C sources and headers by their path in an FMU's sources folder.

    Includes resolve with -I sources.
    """
    found = _own_sources(component) | _sources_in("fmi", _fmi_folder())
    if component is not PLANT:
        found |= {name: path for name, path in _own_sources(PLANT).items() if _is_shared(name)}
    return dict(sorted(found.items()))


def _own_sources(component: Component) -> dict[str, Path]:
    """Returns the sources in the component's own folder."""
    root = (
        _COSIM.parent / component.tree
        if in_source_tree()
        else _COSIM.parent / component.installed / "sources"
    )
    headers = root / "include" / "hexapod" if in_source_tree() else root / "hexapod"
    found = (
        _sources_in("src", root / "src")
        | _sources_in("hexapod", headers)
        | {"component.c": root / "component.c"}
    )
    return found | {f"generated/{name}": root / "generated" / name for name in GENERATED_SOURCES}


def _fmi_folder() -> Path:
    """Returns the folder of the FMI layer, which all components share."""
    return _PLANT_TREE.parent / "fmi" if in_source_tree() else _INSTALLED / "sources" / "fmi"


def _sources_in(name: str, folder: Path) -> dict[str, Path]:
    """Returns C sources and headers of a folder by their path in an FMU's sources folder, where
    the folder is called `name`.
    """
    return {
        f"{name}/{path.relative_to(folder).as_posix()}": path for path in folder.rglob("*.[ch]")
    }


def _is_shared(name: str) -> bool:
    """Returns whether a source of the plant is part of every component."""
    folder, _, file = name.partition("/")
    return {"src": file in SHARED_SOURCES, "hexapod": file in SHARED_HEADERS}.get(folder, False)


def licence_file() -> Path:
    """Returns the path of the licence."""
    return _PLANT_TREE.parent / "LICENSE" if in_source_tree() else _INSTALLED / "LICENSE"


def fmi_headers() -> Path:
    """Returns the folder of the standard's C headers, which fmpy brings. Raises FmuError."""
    spec = util.find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise FmuError(
            "no FMI headers", got="no package fmpy", expected="fmpy", fix="pip install fmpy"
        )
    return Path(spec.origin).parent / "c-code"


def fmi2_platform() -> str:
    """Returns the folder of an FMI 2 archive for this machine's binary.

    Processors without a name in FMI 2 have FMI 3's name (FMI 2.0.5, section 2.3). darwin64 is for
    both processors of Macs.
    """
    system = {"win32": "win", "darwin": "darwin"}.get(sys.platform, "linux")
    if system != "darwin" and platform.machine().lower() not in X86:
        return fmi3_platform()
    return system + ("64" if sys.maxsize > 2**32 else "32")


def fmi3_platform() -> str:
    """Returns the folder of an FMI 3 archive for this machine's binary."""
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    return f"{machine}-{system}"


def packed_binary(folder: str | Path, identifier: str) -> str | None:
    """Returns the path of this machine's binary in an unpacked FMI 2 FMU.

    None if it is not there: then fmpy looks for it, on Arm in linux64 too.
    """
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    path = Path(folder).resolve() / "binaries" / fmi2_platform() / f"{identifier}{suffix}"
    return str(path) if path.is_file() else None


def binary(fmi_platform: str, component: Component = PLANT) -> Path:
    """Returns the newest installed binary of a component for a platform such as linux64.

    An installation that was compiled on this machine has one folder of binaries, with FMI 2's
    name; a released wheel has one for each platform, with FMI 3's name.

    Raises FmuError when there is none or it is older than its sources.
    """
    names = {fmi_platform}
    if fmi_platform == fmi2_platform():
        names.add(fmi3_platform())
    found = [
        path
        for folder in plant_folders()
        for name in names
        for path in (folder / "binaries" / name).glob(f"{component.identifier}.*")
    ]
    if not found:
        platforms = installed_platforms()
        expected = "one of: " + ", ".join(platforms) if platforms else "a built one"
        raise FmuError(
            f"no {component.name} binary for this platform",
            got=fmi_platform,
            expected=expected,
            fix=BUILD,
        )
    newest = max(found, key=lambda path: path.stat().st_mtime)
    table = {"interface.toml": interface_file(component)}
    _refuse_stale(newest, f"the {component.name} binary", source_files(component) | table)
    return newest


def released_binary(fmi_platform: str, identifier: str) -> bytes | None:
    """Returns the binary that a released wheel contains for a platform with FMI 3's name.

    None in a source tree and in a wheel that was built for one machine.
    """
    if in_source_tree():
        return None
    for path in (_INSTALLED / "binaries" / fmi_platform).glob(f"{identifier}.*"):
        return path.read_bytes()
    return None


def shared_library(name: str) -> Path:
    """Returns the newest installed shared library of this package, such as the co-simulation
    loop. Raises FmuError when there is none or it is older than its sources.
    """
    found = [path for folder in plant_folders() for path in (folder / "lib").glob(f"{name}.[sd]*")]
    if not found:
        raise FmuError("a library is missing", got=f"no {name}", expected="a built one", fix=BUILD)
    newest = max(found, key=lambda path: path.stat().st_mtime)
    sources: dict[str, Path] = {}
    for folder in loop_folders()[name]:
        sources |= _sources_in(folder.name, folder)
    _refuse_stale(newest, f"the library {name}", sources)
    return newest


def loop_folders() -> dict[str, list[Path]]:
    """Returns the folders of the sources of each library with the co-simulation loop, by its name.

    The libraries of extensions contain the core's loop.
    """
    core, added = _COSIM / "master", (_COSIM.parent / "extensions").glob("*/loop")
    own = {f"hexapod_{path.parent.name}": [core, path] for path in sorted(added)}
    return {LOOP: [core]} | own


def installed_platforms() -> list[str]:
    """Returns the platforms of the installed binaries."""
    return sorted(
        {
            path.name
            for folder in plant_folders()
            for path in (folder / "binaries").glob("*")
            if path.is_dir()
        }
    )


def _modification_time(path: Path) -> int:
    """Returns a file's time in whole seconds.

    Installation drops the fraction; with it, a binary would be older than a source that was written
    in the same second.
    """
    return int(path.stat().st_mtime)


def _refuse_stale(path: Path, what: str, sources: Mapping[str, Path]) -> None:
    """Raises FmuError when sources of the source tree are newer than the binary."""
    if not in_source_tree():
        return
    changed = [
        name
        for name, source in sources.items()
        if _modification_time(source) > _modification_time(path)
    ]
    if changed:
        raise FmuError(
            f"{what} is older than its sources",
            got=", ".join(changed),
            expected="none changed",
            fix=BUILD,
            where=str(path),
        )


def plant_folders() -> list[Path]:
    """Returns the folders where binaries may be, each laid out as the wheel's hexapod_cosim/plant.

    An editable install keeps it in site-packages, a build in build/plant.
    """
    if not in_source_tree():
        return [_INSTALLED]
    return [Path(entry) / "hexapod_cosim" / "plant" for entry in sys.path] + [
        _PLANT_TREE.parent / "build" / "plant"
    ]
