"""Builds an FMU's binaries for the platforms of the standard.

One cross compiler (cosim/export/cross_build.py) builds all of them, this machine's too, so that the
same package gives the same bytes on every machine, and binaries need an old C library only. A
released wheel contains what this compiler built. Unless platforms are chosen, an FMU gets the
binary that was installed with this package.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor

from hexapod_cosim.cosim.common.binaries import join_mach_o
from hexapod_cosim.cosim.common.components import PLANT, Component
from hexapod_cosim.cosim.common.plant_files import fmi_headers, released_binary, source_files
from hexapod_cosim.cosim.export.cross_build import TARGETS, Library, build_library, find_compiler
from hexapod_cosim.models.errors import FmuError

ALL, SOURCES = "all", "sources"

# FMI 2 has its own names for 64-bit x86 and FMI 3's names for other processors (FMI 2.0.5, section
# 2.3). darwin64 is for both processors of Macs: importers on either look there.
_FMI2 = {
    "linux64": ("x86_64-linux",),
    "win64": ("x86_64-windows",),
    "darwin64": ("x86_64-darwin", "aarch64-darwin"),
    "aarch64-linux": ("aarch64-linux",),
}
_FMI3 = {name: (name,) for name in TARGETS}


def platform_targets(fmi: int) -> Mapping[str, tuple[str, ...]]:
    """Returns the targets of the compiler for each folder of binaries/ in an FMU."""
    return _FMI2 if fmi == 2 else _FMI3


def choose_platforms(names: Iterable[str], *, fmi: int) -> list[str]:
    """Returns the folders of binaries/ for platform names of either version of the standard.

    "all" stands for all folders, "sources" for none. darwin64 of FMI 2 stands for the two platforms
    of FMI 3, and each of them for darwin64. Raises FmuError for an unknown name.
    """
    chosen = [names] if isinstance(names, str) else list(names)
    targets: set[str] = set()
    for name in chosen:
        if name not in {*_FMI2, *_FMI3, ALL, SOURCES}:
            expected = ", ".join(
                (*dict.fromkeys((*_FMI2, *_FMI3)), ALL, f"{SOURCES} for no binary at all")
            )
            raise FmuError(
                "no such platform",
                got=name,
                expected=expected,
                fix="name some of these, separated by commas",
            )
        targets.update(TARGETS if name == ALL else _FMI2.get(name, _FMI3.get(name, ())))
    if SOURCES in chosen and len(chosen) > 1:
        raise FmuError(
            "contradicting platforms",
            got=", ".join(chosen),
            expected=f"{SOURCES} alone",
            fix=f"leave out {SOURCES}",
        )
    folders = platform_targets(fmi).items()
    return [folder for folder, parts in folders if targets.intersection(parts)]


def component_library(component: Component = PLANT) -> Library:
    """Returns the sources of a component's FMU as a library."""
    return Library(component.identifier, source_files(component), (fmi_headers(),))


def build_binaries(library: Library, platforms: Iterable[str], *, fmi: int) -> dict[str, bytes]:
    """Builds shared libraries in parallel, or takes them from a released wheel or the cache.

    Returns them by path in the FMU, such as binaries/linux64/hexapod.so.

    Args:
        library: the library to build.
        platforms: folders, as `choose_platforms` returns them.
        fmi: version of the standard.

    Raises FmuError without a cross compiler, and for sources that do not compile.
    """
    wanted = {name: platform_targets(fmi)[name] for name in platforms}
    targets = list(dict.fromkeys(target for parts in wanted.values() for target in parts))
    released = {target: released_binary(target, library.name) for target in targets}
    built = {target: data for target, data in released.items() if data is not None}
    missing = [target for target in targets if target not in built]
    if missing:
        built |= _compile(library, missing)
    return {
        _member(library, name, parts): _joined([built[part] for part in parts])
        for name, parts in wanted.items()
    }


def _compile(library: Library, targets: list[str]) -> dict[str, bytes]:
    """Builds a library for several targets in parallel."""
    compiler = find_compiler()
    with ThreadPoolExecutor(len(targets)) as pool:
        libraries = pool.map(
            lambda target: build_library(library, target, compiler=compiler), targets
        )
        return dict(zip(targets, libraries, strict=True))


def _member(library: Library, folder: str, targets: tuple[str, ...]) -> str:
    """Returns the path of a library in the FMU."""
    return f"binaries/{folder}/{library.name}{TARGETS[targets[0]].suffix}"


def _joined(parts: list[bytes]) -> bytes:
    """Joins the binaries of one folder to one file."""
    return parts[0] if len(parts) == 1 else join_mach_o(parts)
