"""Checks the files of an FMU's archive besides modelDescription.xml: ZIP format, sources, binaries,
terminals, documentation, licence, grids.
"""

from __future__ import annotations

import posixpath
import re
import stat
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import fmpy

from hexapod_cosim.cosim.common.binaries import incomplete
from hexapod_cosim.cosim.export.extras import LICENCE, PICTURES
from hexapod_cosim.cosim.interface.terminals import FOLDER, ICON
from hexapod_cosim.cosim.validate.description import (
    description_problems,
    schema_problems,
    variables,
)
from hexapod_cosim.cosim.validate.grids import grid_problems
from hexapod_cosim.cosim.validate.related import related_problems
from hexapod_cosim.cosim.validate.variable import INTERFACES

DESCRIPTION, PAGE = "modelDescription.xml", "documentation/index.html"
TERMINALS = f"{FOLDER}/terminalsAndIcons.xml"
BUILD_DESCRIPTION = "sources/buildDescription.xml"
# headers of the standard, which importers have; the first declares all functions
HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
DEFLATE_VERSION = 20  # the latest version of the ZIP format that the standard allows
DESCRIPTOR = 1 << 3  # general purpose bit: sizes are stored after the data
PNG = b"\x89PNG\r\n\x1a\n"
# of each platform's binaries: suffix, magic number, offset and bytes of the machine type
ELF, PE, MACH = b"\x7fELF", b"MZ", b"\xcf\xfa\xed\xfe"
PLATFORMS = {
    "linux64": (".so", ELF, 18, b"\x3e\x00"),
    "win64": (".dll", PE, None, b"\x64\x86"),
    "darwin64": (".dylib", MACH, 4, b"\x07\x00\x00\x01"),
    "x86_64-linux": (".so", ELF, 18, b"\x3e\x00"),
    "aarch64-linux": (".so", ELF, 18, b"\xb7\x00"),
    "x86_64-windows": (".dll", PE, None, b"\x64\x86"),
    "x86_64-darwin": (".dylib", MACH, 4, b"\x07\x00\x00\x01"),
    "aarch64-darwin": (".dylib", MACH, 4, b"\x0c\x00\x00\x01"),
}
# universal Mach-O: magic; offset and size of the entries, which are big-endian
FAT, FAT_ENTRIES, FAT_ENTRY_SIZE = b"\xca\xfe\xba\xbe", 8, 20
PE_HEADER = 0x3C  # offset of the address of a PE file's header
# absolute paths of the machine where a file was made
ABSOLUTE = re.compile(
    rb"(?:/home/|/root/|/Users/|/tmp/|/work/"
    rb"|[A-Z]:[\\/](?:Users|Windows|Program Files|build|work|src)[\\/])[\w.+-]+"
)


def archive_problems(path: Path) -> list[str]:
    """Returns the problems of an FMI 2.0 archive and its documents, one sentence each.

    Raises KeyError without a modelDescription.xml.
    """
    found, problems = read_members(path)
    if found is None:
        return problems
    problems += schema_problems(DESCRIPTION, found[DESCRIPTION], "fmi2/fmi2ModelDescription.xsd")
    if problems:
        return problems
    root = ElementTree.fromstring(found[DESCRIPTION])
    problems += [*description_problems(root), *_source_problems(root, found)]
    return problems + member_problems(
        root, found, [variable.name for variable in variables(root)], fmi=2
    )


def read_members(path: Path) -> tuple[dict[str, bytes] | None, list[str]]:
    """Returns the archive's files by path (None if one is damaged) and its problems as a ZIP.

    The problems of a damaged archive are the names of its damaged files.
    """
    found, damaged = {}, []
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            try:
                found[name] = archive.read(name)
            except zipfile.BadZipFile:
                damaged.append(f"{name} is damaged: its checksum is wrong")
            except Exception:  # zlib's and others, for data that cannot be unpacked
                damaged.append(f"{name} is damaged: it cannot be unpacked")
        files = {name: data for name, data in found.items() if not name.endswith("/")}
        return (None, damaged) if damaged else (files, list(zip_problems(archive)))


def member_problems(
    root: Element, found: dict[str, bytes], names: Iterable[str], *, fmi: int
) -> list[str]:
    """Returns the problems of an archive's files, for either version of the standard.

    Args:
        root: of modelDescription.xml.
        found: the files by path.
        names: of the variables.
        fmi: version of the standard.
    """
    checks = (
        include_problems(found, fmi),
        binary_problems(root, found, fmi),
        terminal_problems(set(names), found),
        document_problems(found, fmi),
        grid_problems(found),
        related_problems(set(names), found),
    )
    return [problem for check in checks for problem in check]


def zip_problems(archive: zipfile.ZipFile) -> Iterator[str]:
    """Yields violations of section 2.3: what every ZIP reader can be expected to handle."""
    names = archive.namelist()
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield f"{name} is there more than once"
    for info in archive.infolist():
        name = info.filename
        if (
            name.startswith("/")
            or "\\" in info.orig_filename
            or ".." in PurePosixPath(name).parts
            or ":" in name
        ):
            yield f"{name!r} is no path inside the archive"
        if not name.isascii():
            yield f"{name!r} is not ASCII: unpackers disagree about its encoding"
        if (
            info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
            or info.extract_version > DEFLATE_VERSION
        ):
            yield (
                f"{name} is packed by method {info.compress_type}, version "
                f"{info.extract_version}; expected store or deflate, 2.0"
            )
        if info.flag_bits & DESCRIPTOR and info.compress_type == zipfile.ZIP_STORED:
            yield f"{name} is stored with its size behind it"
        if stat.S_ISLNK(info.external_attr >> 16):
            yield f"{name} is a link"


def _source_problems(root: Element, found: dict[str, bytes]) -> Iterator[str]:
    """Yields sources that are listed but missing, or present but not listed."""
    present = {name.removeprefix("sources/") for name in found if name.startswith("sources/")}
    for interface in root.iterfind("*"):
        if interface.tag not in INTERFACES:
            continue
        listed = [file.get("name", "") for file in interface.iterfind("SourceFiles/File")]
        for name in sorted(set(listed) - present):
            yield f"{interface.tag} lists the source {name}, which is not in the archive"
        for name in sorted(name for name in present - set(listed) if name.endswith(".c")):
            yield f"sources/{name} is not listed by {interface.tag}"
        for name in sorted({name for name in listed if listed.count(name) > 1}):
            yield f"{interface.tag} lists the source {name} more than once"


def include_problems(found: dict[str, bytes], fmi: int) -> Iterator[str]:
    """Yields included headers that are missing, and headers of the standard, which must be."""
    present = {name.removeprefix("sources/") for name in found if name.startswith("sources/")}
    for name in sorted(present):
        if PurePosixPath(name).name in HEADERS[fmi]:
            yield f"sources/{name} is the standard's, which importers have themselves"
        includes = [
            include
            for include in _includes(found[f"sources/{name}"])
            if include not in HEADERS[fmi]
        ]
        missing = [include for include in includes if not _is_there(include, name, present)]
        for include in missing:
            yield f'sources/{name} includes "{include}", which is not in the archive'


def _includes(text: bytes) -> list[str]:
    """Returns the names in quotes that a source includes."""
    return [
        include.decode(errors="replace")
        for include in re.findall(rb'^\s*#\s*include\s+"([^"]+)"', text, re.MULTILINE)
    ]


def _is_there(include: str, name: str, present: Iterable[str]) -> bool:
    """Returns whether an included file is among the sources."""
    return include in present or posixpath.normpath(PurePosixPath(name).parent / include) in present


def standard_functions(fmi: int = 2) -> list[str]:
    """Returns the functions of the standard that a binary must export."""
    text = (Path(fmpy.__file__).parent / "c-code" / HEADERS[fmi][0]).read_text(encoding="utf-8")
    return re.findall(r"FMI[23]_Export fmi[23]\w+TYPE\s+(fmi[23]\w+);", text)


def binary_problems(root: Element, found: dict[str, bytes], fmi: int) -> Iterator[str]:
    """Yields folders of unknown platforms and missing or invalid libraries."""
    elements = [root.find(name) for name in INTERFACES]
    identifiers = {
        str(element.get("modelIdentifier")) for element in elements if element is not None
    }
    platforms = sorted(
        {PurePosixPath(name).parts[1] for name in found if name.startswith("binaries/")}
    )
    if not platforms and not any(name.startswith("sources/") for name in found):
        yield "neither binaries nor sources are there"
    for platform in platforms:
        if platform not in PLATFORMS:
            yield f"binaries/{platform} is no platform of the standard: {', '.join(PLATFORMS)}"
            continue
        for identifier in sorted(identifiers):
            name = f"binaries/{platform}/{identifier}{PLATFORMS[platform][0]}"
            if name in found:
                yield from library_problems(name, found[name], platform, fmi=fmi)
            else:
                yield f"{name} is missing: importers look for the modelIdentifier"


def library_problems(name: str, data: bytes, platform: str, *, fmi: int = 2) -> Iterator[str]:
    """Yields the problems of a library; reads its bytes, since its platform may be another."""
    _, magic, place, machine = PLATFORMS[platform]
    machines = _machine_types(data, magic, place, len(machine))
    known_magic = (MACH, FAT) if magic == MACH else (magic,)
    if not data.startswith(known_magic) or machine not in machines:
        yield f"{name} is no library of {platform}"
        return
    damage = incomplete(data)
    if damage:
        yield f"{name} cannot be loaded: {damage}"
    start = b"\0_" if magic == MACH else b"\0"
    missing = [
        function
        for function in standard_functions(fmi)
        if start + function.encode() + b"\0" not in data
    ]
    if missing:
        yield f"{name} lacks {len(missing)} functions of the standard: {', '.join(missing)}"


def _machine_types(data: bytes, magic: bytes, place: int | None, size: int) -> list[bytes]:
    """Returns the machine types of a library, `size` bytes each; several of a universal one.

    place: their offset; None: behind the PE header.
    """
    if magic == MACH and data.startswith(FAT):
        count = int.from_bytes(data[4:8], "big")
        count = min(count, len(data) // FAT_ENTRY_SIZE)
        offsets = range(FAT_ENTRIES, FAT_ENTRIES + FAT_ENTRY_SIZE * count, FAT_ENTRY_SIZE)
        return [data[at : at + 4][::-1] for at in offsets]
    if place is None:
        place = int.from_bytes(data[PE_HEADER : PE_HEADER + 4], "little") + 4
    return [data[place : place + size]]


def terminal_problems(known: set[str], found: dict[str, bytes]) -> Iterator[str]:
    """Yields problems of terminalsAndIcons.xml: unknown variables, duplicate names, no icon."""
    if TERMINALS not in found:
        return
    broken = schema_problems(TERMINALS, found[TERMINALS], "fmi3/fmi3TerminalsAndIcons.xsd")
    yield from broken
    if broken:
        return
    document = ElementTree.fromstring(found[TERMINALS])
    if document.find("GraphicalRepresentation") is not None and f"{FOLDER}/{ICON}" not in found:
        yield f"{FOLDER}/{ICON} is missing, though {TERMINALS} places it"
    top = document.find("Terminals")
    if top is not None:
        yield from _group_problems(top, "", known)


def _group_problems(parent: Element, path: str, known: set[str]) -> Iterator[str]:
    """Yields duplicate names and unknown members of the terminals in an element."""
    names = [terminal.get("name") for terminal in parent.iterfind("Terminal")]
    if len(names) != len(set(names)):
        yield f"{TERMINALS}: terminals of {path or 'the FMU'} share a name"
    for terminal in parent.iterfind("Terminal"):
        where = f"{path}{terminal.get('name')}"
        members = list(terminal.iterfind("TerminalMemberVariable"))
        for member in members:
            if member.get("variableName") not in known:
                yield (
                    f"{TERMINALS}: terminal {where} has {member.get('variableName')!r}, which is "
                    "no variable"
                )
        if len({member.get("memberName") for member in members}) != len(members):
            yield f"{TERMINALS}: members of terminal {where} share a name or have none"
        yield from _group_problems(terminal, f"{where}.", known)


def document_problems(found: dict[str, bytes], fmi: int) -> Iterator[str]:
    """Yields missing documents and pictures, and files that contain absolute paths."""
    for name, use in (
        (LICENCE, "the licence"),
        (PAGE, "the documentation"),
        (PICTURES[fmi], "the robot's picture"),
    ):
        if not found.get(name, b"").strip():
            yield f"{name}, {use}, is missing"
    for name in (PICTURES[fmi], f"{FOLDER}/{ICON}"):
        if name in found and not found[name].startswith(PNG):
            yield f"{name} is no PNG"
    for name, data in found.items():
        match = None if name.endswith(".png") else ABSOLUTE.search(data)
        if match:
            yield (
                f"{name} holds a path of the machine it was made on: "
                f"{match[0].decode(errors='replace')}"
            )
