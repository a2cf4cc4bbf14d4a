"""Unpacks ZIP archives of others: nothing is written outside the folder, nothing without a limit.

The limits are stated in docs/trust.md.
"""

from __future__ import annotations

import shutil
import stat
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

from hexapod_cosim.models.errors import FmuError

MEMBERS = 10_000  # the most files and folders of an archive
MEMBER_SIZE = 256 * 2**20  # bytes, unpacked, of one file
TOTAL_SIZE = 512 * 2**20  # bytes, unpacked, of all files
NAME_SIZE = 255  # bytes, of a folder's or file's name
PATH_SIZE = 1000  # bytes, of a path inside the archive
FIX = "take another copy of the file, and none from a place that you do not trust"
NEEDED = "a ZIP file with a modelDescription.xml"
MAKE = "make one with `hexapod export -o FILE.fmu`"


def open_archive(path: Path) -> zipfile.ZipFile:
    """Opens an archive that is safe to unpack. Raises FmuError for any other file."""
    try:
        archive = zipfile.ZipFile(path)
    except Exception as error:  # zipfile raises errors of many types for damaged files
        raise _unreadable(path, "not an FMU", error, NEEDED, MAKE) from error
    problem = next(unsafe_members(archive.infolist()), None)
    if problem is None:
        return archive
    archive.close()
    what, got, expected = problem
    raise FmuError(what, got=got, expected=expected, fix=FIX, where=str(path))


def unpack(path: Path, folder: Path) -> None:
    """Unpacks an archive into an existing folder. Raises FmuError for an unsafe or damaged one."""
    with open_archive(path) as archive:
        for member in archive.infolist():
            target = folder.joinpath(*PurePosixPath(member.filename).parts)
            try:
                _unpack_member(archive, member, target)
            except Exception as error:  # damaged data; a full disk
                what, expected = "a file of the archive cannot be unpacked", "intact data and room"
                raise _unreadable(f"{path}: {member.filename}", what, error, expected) from error


def read_member(archive: zipfile.ZipFile, name: str) -> bytes:
    """Returns a file of an opened archive. Raises FmuError for damaged data."""
    try:
        return archive.read(name)
    except Exception as error:
        what = "a file of the archive is damaged"
        raise _unreadable(f"{archive.filename}: {name}", what, error, "intact data") from error


def _unreadable(
    where: str | Path, what: str, error: Exception, expected: str, fix: str = FIX
) -> FmuError:
    """Returns the error for what zipfile cannot read; its own errors may have no text."""
    got = str(error) or type(error).__name__
    return FmuError(what, got=got, expected=expected, fix=fix, where=str(where))


def _unpack_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo, target: Path) -> None:
    if member.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with archive.open(member) as source, target.open("xb") as file:
        shutil.copyfileobj(source, file)  # zipfile reads no more than the stated size


def unsafe_members(members: Iterable[zipfile.ZipInfo]) -> Iterator[tuple[str, object, str]]:
    """Yields why an archive is not unpacked: what, got, expected."""
    members = list(members)
    if len(members) > MEMBERS:
        yield "the archive has too many files", len(members), f"at most {MEMBERS}"
    total = sum(member.file_size for member in members)
    if total > TOTAL_SIZE:
        yield "the archive is too large unpacked", f"{total} bytes", f"at most {TOTAL_SIZE} bytes"
    for member in members:
        yield from _unsafe_member(member)


def _unsafe_member(member: zipfile.ZipInfo) -> Iterator[tuple[str, object, str]]:
    """Yields why one member is not unpacked."""
    name = member.orig_filename
    parts = name.removesuffix("/").split("/")
    inside = "a path inside the archive, of names between single slashes"
    if "\0" in name or "\\" in name or ":" in name or not {"", ".", ".."}.isdisjoint(parts):
        yield "the archive would write outside its folder", name, inside
    size = len(name.encode("utf-8", "surrogatepass"))
    longest = max(len(part.encode("utf-8", "surrogatepass")) for part in parts)
    if size > PATH_SIZE or longest > NAME_SIZE:
        got, expected = f"{size} bytes", f"names of {NAME_SIZE} bytes, paths of {PATH_SIZE}"
        yield "a path in the archive is too long", got, f"at most {expected}"
    kind = stat.S_IFMT(member.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        yield "the archive has a link or a device", name, "files and folders only"
    if member.file_size > MEMBER_SIZE:
        got = f"{name} of {member.file_size} bytes"
        yield "a file of the archive is too large", got, f"at most {MEMBER_SIZE} bytes"
