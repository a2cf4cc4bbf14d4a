"""Tests binaries for other platforms: format, exported functions and required libraries.

`make test` builds for one platform of each of two systems, `make test-platforms` for all.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import lief
import pytest
from platform_walk import EVERYTHING

from hexapod_cosim.cosim.common.plant_files import fmi_headers, source_files
from hexapod_cosim.cosim.export import cross_build, platforms
from hexapod_cosim.cosim.export.cross_build import TARGETS, build_library, find_compiler, user_cache
from hexapod_cosim.models.errors import FmuError

LINKER_MADE = {
    "__mh_dylib_header",
    "___dso_handle",
}  # Zig's linker for macOS exports two symbols of its own
NEWEST_GLIBC = (2, 17)
EXTENSION = {"hx_shared_work_size", "hx_shared_work_use"}  # hexapod/shared_work.h
SYSTEM = {
    "linux": re.compile(r"lib[cm]\.so\.6"),
    "windows": re.compile(r"KERNEL32\.dll|api-ms-win-crt-[a-z0-9-]+\.dll"),
    "darwin": re.compile(r"@rpath/hexapod\.dylib|/usr/lib/libSystem\.B\.dylib"),
}
MACHINES = {
    "x86_64-linux": "X86_64",
    "aarch64-linux": "AARCH64",
    "x86_64-windows": "AMD64",
    "x86_64-darwin": "X86_64",
    "aarch64-darwin": "ARM64",
}
STANDARD = {
    name
    for version in (2, 3)
    for name in re.findall(
        rf"FMI{version}_Export\s+fmi{version}\w+TYPE\s+(fmi{version}\w+);",
        (fmi_headers() / f"fmi{version}Functions.h").read_text(encoding="utf-8"),
    )
}


BUILT = list(TARGETS) if EVERYTHING else ["x86_64-linux", "aarch64-darwin"]


def system_of(target: str) -> str:
    return target.rpartition("-")[2]


@pytest.fixture(scope="session")
def built() -> dict[str, bytes]:
    """Returns the plant's binaries by target, built in parallel or taken from the cache."""
    library = platforms.component_library()
    with ThreadPoolExecutor() as pool:
        found = pool.map(lambda target: build_library(library, target), BUILT)
        return dict(zip(BUILT, found, strict=True))


@pytest.fixture(params=BUILT)
def target(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def data(built: dict[str, bytes], target: str) -> bytes:
    return built[target]


def parsed(data: bytes) -> Any:
    binary: Any = lief.parse(list(data))
    return binary


def exported(binary: Any) -> set[str]:
    if binary.format == lief.Binary.FORMATS.PE:
        return {entry.name for entry in binary.get_export().entries}
    names = {symbol.name for symbol in binary.exported_symbols}
    return (
        {name.removeprefix("_") for name in names - LINKER_MADE}
        if binary.format == lief.Binary.FORMATS.MACHO
        else names
    )


def libraries(binary: Any) -> list[str]:
    return [entry if isinstance(entry, str) else entry.name for entry in binary.libraries]


def machine(binary: Any) -> str:
    header = binary.header
    kind = (
        header.machine
        if binary.format == lief.Binary.FORMATS.PE
        else getattr(header, "machine_type", None) or header.cpu_type
    )
    return str(kind).rpartition(".")[2]


def test_each_binary_is_for_its_machine(data: bytes, target: str) -> None:
    assert machine(parsed(data)) == MACHINES[target]


def test_each_binary_exports_the_standard_s_functions_and_one_extension(data: bytes) -> None:
    assert len(STANDARD) == 44 + 75
    assert exported(parsed(data)) == STANDARD | EXTENSION


def test_each_binary_requires_the_c_library_only(data: bytes, target: str) -> None:
    needed = libraries(parsed(data))
    assert needed
    assert [name for name in needed if not SYSTEM[system_of(target)].fullmatch(name)] == []


def protections(binary: Any) -> tuple[bool, bool]:
    """Returns whether relocations become read-only, and whether all are done at load time."""
    relro = any(segment.type == lief.ELF.Segment.TYPE.GNU_RELRO for segment in binary.segments)
    flags = [
        str(entry)
        for entry in binary.dynamic_entries
        if entry.tag in (lief.ELF.DynamicEntry.TAG.FLAGS, lief.ELF.DynamicEntry.TAG.FLAGS_1)
    ]
    return relro, any("NOW" in flag for flag in flags)


def newest_glibc(binary: Any) -> tuple[int, ...]:
    versions = [
        entry.name
        for need in binary.symbols_version_requirement
        for entry in need.get_auxiliary_symbols()
    ]
    return max(tuple(map(int, version.removeprefix("GLIBC_").split("."))) for version in versions)


@pytest.mark.parametrize("target", [name for name in BUILT if name.endswith("linux")])
def test_linux_binaries_run_with_glibc_2_17_and_are_read_only_where_they_can(
    built: dict[str, bytes], target: str
) -> None:
    binary = parsed(built[target])
    assert newest_glibc(binary) <= NEWEST_GLIBC
    assert protections(binary) == (True, True)
    assert not list(binary.symtab_symbols)


def plant_sources() -> list[Path]:
    return [path for name, path in source_files().items() if name.endswith(".c")]


def compiled(folder: Path, sources: list[Path], *command: str) -> Any:
    """Compiles sources as importers do, with flags for a shared library and those given."""
    out = folder / "plain.so"
    plant, root = source_files()["component.c"].parent, source_files()["fmi/fmi2.c"].parents[1]
    folders = (root, plant, plant / "include")
    includes = [*(f"-I{folder}" for folder in folders), "-isystem", str(fmi_headers())]
    environment = cross_build.compiler_environment(folder, user_cache())
    subprocess.run(
        [*command, "-shared", "-fPIC", *includes, *map(str, sources), "-lm", "-o", str(out)],
        check=True,
        env=environment,
    )
    return lief.parse(str(out))


def test_internal_names_are_hidden_in_binaries_that_importers_compile(tmp_path: Path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler, "these tests need a C compiler"
    ours = {
        name
        for name in exported(compiled(tmp_path, plant_sources(), compiler, "-O0"))
        if not name.startswith("_")
    }
    assert ours == STANDARD | EXTENSION


def fused(binary: Any) -> int:
    """Returns the fused multiply-adds in code for 64-bit Arm: scalar (fmadd and variants), vector
    (fmla, fmls), and vector by element.
    """
    code = bytes(binary.get_section(".text").content)
    words = [
        int.from_bytes(code[place : place + 4], "little") for place in range(0, len(code) - 3, 4)
    ]
    return sum(
        word >> 24 == 0x1F or word & 0xBF20FC00 == 0x0E20CC00 or word & 0xBF80B400 == 0x0F801000
        for word in words
    )


@pytest.mark.skipif(not EVERYTHING, reason="compiles the plant once more: make test-platforms")
def test_arm_compilers_do_not_fuse_our_arithmetic(tmp_path: Path) -> None:
    command = (*find_compiler().command, "-target", TARGETS["aarch64-linux"].triple, "-O1")
    eager = tmp_path / "eager.c"
    eager.write_text(
        "double f(double a, double b, double c) { return a * b + c; }\n", encoding="utf-8"
    )
    assert fused(compiled(tmp_path, [eager], *command)) == 1
    assert fused(compiled(tmp_path, plant_sources(), *command)) == 0


def test_each_version_of_the_standard_has_its_own_names() -> None:
    assert platforms.choose_platforms("all", fmi=2) == [
        "linux64",
        "win64",
        "darwin64",
        "aarch64-linux",
    ]
    assert platforms.choose_platforms("all", fmi=3) == list(TARGETS)
    assert platforms.choose_platforms(["win64", "linux64"], fmi=2) == ["linux64", "win64"]
    with pytest.raises(FmuError, match="contradicting"):
        platforms.choose_platforms(["sources", "linux64"], fmi=2)


def test_both_versions_accept_both_standards_names() -> None:
    assert platforms.choose_platforms(["win64", "darwin64"], fmi=3) == [
        "x86_64-windows",
        "x86_64-darwin",
        "aarch64-darwin",
    ]
    assert platforms.choose_platforms(["x86_64-windows", "x86_64-linux"], fmi=2) == [
        "linux64",
        "win64",
    ]
    assert platforms.choose_platforms(["aarch64-darwin"], fmi=3) == ["aarch64-darwin"]
    assert platforms.choose_platforms(["aarch64-darwin", "x86_64-darwin"], fmi=2) == [
        "darwin64"
    ]  # a universal binary is one file for both
    assert platforms.choose_platforms(["win64", "x86_64-windows"], fmi=3) == ["x86_64-windows"]
    assert platforms.choose_platforms(["sources"], fmi=3) == []
    with pytest.raises(FmuError, match="got 'win32', expected linux64, win64"):
        platforms.choose_platforms(["win32"], fmi=3)
