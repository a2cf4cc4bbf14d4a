"""Which platforms an FMU can hold binaries for, under the names each version of the standard gives
them, and their binaries.

One compiler (cosim/export/cross_build.py) makes all of them, this machine's too: then the same
package makes the same bytes wherever it runs, and a binary needs no newer C library than any
importer has. Without a choice an FMU gets the binary that was installed with this package.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

from hexapod_cosim.cosim.common.components import PLANT, Component
from hexapod_cosim.cosim.common.plant_files import fmi_headers, source_files
from hexapod_cosim.cosim.export.cross_build import TARGETS, Library, build_library, find_compiler
from hexapod_cosim.cosim.export.fat_binary import join_mach_o
from hexapod_cosim.models.errors import FmuError

ALL, SOURCES = "all", "sources"

# FMI 2 names 64-bit x86 in its own way and takes FMI 3's names for everything else (2.0.5, section
# 2.3). darwin64 is for both processors of Macs: importers on either look there.
_FMI2 = {
    "linux64": ("x86_64-linux",),
    "win64": ("x86_64-windows",),
    "darwin64": ("x86_64-darwin", "aarch64-darwin"),
    "aarch64-linux": ("aarch64-linux",),
}
_FMI3 = {name: (name,) for name in TARGETS}


def platform_targets(fmi: int) -> Mapping[str, tuple[str, ...]]:
    """Folders below binaries in an FMU of a version of the standard, and the targets of the
    compiler that go into each.
    """
    return _FMI2 if fmi == 2 else _FMI3


def choose_platforms(names: Iterable[str], *, fmi: int) -> list[str]:
    """The folders that names stand for: "all", "sources" for none, or platforms as either version
    of the standard calls them.

    A platform of FMI 2 that is several of FMI 3 (darwin64) stands for all of these, and each of
    these for it. Raises FmuError for a name that is none of these.
    """
    chosen, targets, known = (
        [names] if isinstance(names, str) else list(names),
        set[str](),
        platform_targets(fmi),
    )
    for name in chosen:
        if name not in _FMI2 and name not in _FMI3 and name not in (ALL, SOURCES):
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
    return [folder for folder, parts in known.items() if targets.intersection(parts)]


def component_library(component: Component = PLANT) -> Library:
    """The library of a component's FMU."""
    return Library(component.identifier, source_files(component), (fmi_headers(),))


def build_binaries(library: Library, platforms: Iterable[str], *, fmi: int) -> dict[str, bytes]:
    """Shared libraries by their path in an FMU (binaries/linux64/hexapod.so), built at once, or
    taken from the cache.

    Args:
        library: what to build.
        platforms: folders, as `choose_platforms` returns them.
        fmi: version of the standard.

    Raises FmuError: no cross compiler, or sources it does not compile.
    """
    wanted = {name: platform_targets(fmi)[name] for name in platforms}
    targets = list(dict.fromkeys(target for parts in wanted.values() for target in parts))
    if not targets:
        return {}
    compiler = find_compiler()
    with _workers(len(targets)) as pool:
        built = dict(
            zip(
                targets,
                pool.map(lambda target: build_library(library, target, compiler=compiler), targets),
                strict=True,
            )
        )
    return {
        _member(library, name, parts): _joined([built[part] for part in parts])
        for name, parts in wanted.items()
    }


@contextmanager
def _workers(count: int) -> Iterator[ThreadPoolExecutor]:
    """Threads that each wait for a compiler. What has not begun is dropped when one fails or the
    user interrupts.
    """
    pool = ThreadPoolExecutor(count)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _member(library: Library, folder: str, targets: tuple[str, ...]) -> str:
    return f"binaries/{folder}/{library.name}{TARGETS[targets[0]].suffix}"


def _joined(parts: list[bytes]) -> bytes:
    return parts[0] if len(parts) == 1 else join_mach_o(parts)
