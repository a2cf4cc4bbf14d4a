"""Is an FMU's archive whole? Its ZIP, sources, binaries, terminals, licence: what checkers of
modelDescription.xml do not look at.
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

from hexapod_cosim.cosim.export.extras import LICENCE, PICTURES
from hexapod_cosim.cosim.interface.terminals import FOLDER, ICON
from hexapod_cosim.cosim.validate.description import (
    description_problems,
    schema_problems,
    variables,
)
from hexapod_cosim.cosim.validate.variable import INTERFACES

DESCRIPTION, TERMINALS, PAGE = (
    "modelDescription.xml",
    f"{FOLDER}/terminalsAndIcons.xml",
    "documentation/index.html",
)
BUILD_DESCRIPTION = "sources/buildDescription.xml"
# the importer's own headers, by version of the standard; the first declares all functions
HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
DEFLATE_VERSION = 20  # of the ZIP format, the latest that the standard lets an FMU need
DESCRIPTOR = 1 << 3  # general purpose bit: sizes stand behind the data
PNG = b"\x89PNG\r\n\x1a\n"
# suffix, magic number, and bytes of it that tell the machine, of what each platform's folder holds
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
FAT, FAT_ENTRIES = (
    b"\xca\xfe\xba\xbe",
    8,
)  # libraries of several machines in one Mach-O file; where the list of them begins, big-endian
PE_HEADER = 0x3C  # where a PE file says where its header is
# paths that only the machine where it was made has
ABSOLUTE = re.compile(
    rb"(?:/home/|/root/|/Users/|/tmp/|/work/|[A-Z]:[\\/](?:Users|Windows|Program Files|build|work|src)[\\/])[\w.+-]+"
)


def archive_problems(path: Path) -> list[str]:
    """What is wrong with the archive and its documents, one sentence each. Raises KeyError
    without a modelDescription.xml.
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
    """The archive's files by path, None if one is damaged; and what is wrong with it as a ZIP."""
    with zipfile.ZipFile(path) as archive:
        damaged = archive.testzip()
        if damaged:
            return None, [f"{damaged} is damaged: its checksum is wrong"]
        found = {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
        return found, list(zip_problems(archive))


def member_problems(
    root: Element, found: dict[str, bytes], names: Iterable[str], *, fmi: int
) -> list[str]:
    """What is wrong with an archive's members, for either version of the standard.

    Args:
        root: of modelDescription.xml.
        found: the members by path.
        names: the variables'.
        fmi: version of the standard.
    """
    checks = (
        include_problems(found, fmi),
        binary_problems(root, found, fmi),
        terminal_problems(set(names), found),
        document_problems(found, fmi),
    )
    return [problem for check in checks for problem in check]


def zip_problems(archive: zipfile.ZipFile) -> Iterator[str]:
    """Section 2.3: what any unpacker can be expected to handle."""
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
            yield f"{name} is packed by method {info.compress_type}, version {info.extract_version}; expected store or deflate, 2.0"
        if info.flag_bits & DESCRIPTOR and info.compress_type == zipfile.ZIP_STORED:
            yield f"{name} is stored with its size behind it"
        if stat.S_ISLNK(info.external_attr >> 16):
            yield f"{name} is a link"


def _source_problems(root: Element, found: dict[str, bytes]) -> Iterator[str]:
    """Sources listed and present, both ways, for each interface."""
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
    """Headers that sources include, there but for the standard's."""
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
    return [
        include.decode()
        for include in re.findall(rb'^\s*#\s*include\s+"([^"]+)"', text, re.MULTILINE)
    ]


def _is_there(include: str, name: str, present: Iterable[str]) -> bool:
    return include in present or posixpath.normpath(PurePosixPath(name).parent / include) in present


def standard_functions(fmi: int = 2) -> list[str]:
    """Every function that the standard asks of a binary."""
    text = (Path(fmpy.__file__).parent / "c-code" / HEADERS[fmi][0]).read_text(encoding="utf-8")
    return re.findall(r"FMI[23]_Export fmi[23]\w+TYPE\s+(fmi[23]\w+);", text)


def binary_problems(root: Element, found: dict[str, bytes], fmi: int) -> Iterator[str]:
    """A library for every interface in each platform's folder."""
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
    """By its bytes alone, so that it works for machines that are not this one."""
    _, magic, place, machine = PLATFORMS[platform]
    if magic == MACH and data.startswith(FAT):
        magic, entries = FAT, int.from_bytes(data[4:8], "big")
        machines = [
            data[at : at + 4][::-1] for at in range(FAT_ENTRIES, FAT_ENTRIES + 20 * entries, 20)
        ]
    else:
        at = (
            int.from_bytes(data[PE_HEADER : PE_HEADER + 4], "little") + 4
            if place is None
            else place
        )
        machines = [data[at : at + len(machine)]]
    if not data.startswith(magic) or machine not in machines:
        yield f"{name} is no library of {platform}"
        return
    start = b"\0_" if magic in (MACH, FAT) else b"\0"
    missing = [
        function
        for function in standard_functions(fmi)
        if start + function.encode() + b"\0" not in data
    ]
    if missing:
        yield f"{name} lacks {len(missing)} functions of the standard: {', '.join(missing)}"


def terminal_problems(known: set[str], found: dict[str, bytes]) -> Iterator[str]:
    """Terminals of known variables, and the icon that they place."""
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
    """Terminals below one, their names and members."""
    names = [terminal.get("name") for terminal in parent.iterfind("Terminal")]
    if len(names) != len(set(names)):
        yield f"{TERMINALS}: terminals of {path or 'the FMU'} share a name"
    for terminal in parent.iterfind("Terminal"):
        where = f"{path}{terminal.get('name')}"
        members = list(terminal.iterfind("TerminalMemberVariable"))
        for member in members:
            if member.get("variableName") not in known:
                yield f"{TERMINALS}: terminal {where} has {member.get('variableName')!r}, which is no variable"
        if len({member.get("memberName") for member in members}) != len(members):
            yield f"{TERMINALS}: members of terminal {where} share a name or have none"
        yield from _group_problems(terminal, f"{where}.", known)


def document_problems(found: dict[str, bytes], fmi: int) -> Iterator[str]:
    """Licence, page and pictures there; nothing that tells of the machine where they were made."""
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
            yield f"{name} holds a path of the machine it was made on: {match[0].decode(errors='replace')}"
