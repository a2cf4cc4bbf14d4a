"""Shared libraries: whether one is complete, before the system maps it into this process, and
several of macOS as one.

A library that was cut short is mapped all the same: the process then ends with SIGBUS when it
reaches a page behind the file's end.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

from hexapod_cosim.models.errors import FmuError

# first bytes of libraries of Linux, Windows and macOS, and of several joined for macOS
ELF, PE, MACH, FAT = b"\x7fELF", b"MZ", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe"
PAGE_BITS = 14  # slices begin at multiples of 16 KiB, the larger of the processors' pages
LOADED, SEGMENT = 1, 0x19  # PT_LOAD; LC_SEGMENT_64


def refuse_incomplete(path: str | Path) -> None:
    """Raises FmuError for a library that is cut short, damaged or none."""
    problem = incomplete(Path(path).read_bytes())
    if problem:
        raise FmuError(
            "the FMU's binary cannot be loaded",
            got=problem,
            expected="a complete library",
            fix="export the FMU again with `hexapod export`",
            where=Path(path).name,
        )


def incomplete(data: bytes) -> str | None:
    """Returns what is wrong with the parts that a library's header lists, or None."""
    try:
        missing = missing_bytes(data)
    except ValueError as error:
        return str(error)
    return f"{missing} bytes are missing at its end" if missing else None


def missing_bytes(data: bytes) -> int:
    """Returns how many bytes a library lacks at its end; 0 for a complete one.

    Raises ValueError for data that is no library of Linux, Windows or macOS.
    """
    try:
        end = max(_ends(data), default=0)
    except struct.error as error:
        raise ValueError("its header is cut short or damaged") from error
    return max(end - len(data), 0)


def _ends(data: bytes) -> Iterator[int]:
    """Yields where the parts of a library end that its header lists."""
    if data.startswith(ELF) and data[4:5] in (b"\x01", b"\x02") and data[5:6] in (b"\x01", b"\x02"):
        return _elf_ends(data)
    if data.startswith(PE):
        return _pe_ends(data)
    if data.startswith(MACH):
        return _mach_ends(data, 0)
    if data.startswith(FAT):
        return _fat_ends(data)
    raise ValueError("it is no shared library")


def _elf_ends(data: bytes) -> Iterator[int]:
    """Yields the ends of the segments and of the table of sections."""
    order = "<" if data[5] == 1 else ">"
    wide = data[4] == 2
    layout, at = ("QQIHHHHHH", 32) if wide else ("IIIHHHHHH", 28)
    head = struct.unpack_from(order + layout, data, at)
    segments, sections, _, _, size, number, section_size, section_number, _ = head
    for place in range(segments, segments + size * number, max(size, 1)):
        kind = struct.unpack_from(order + "I", data, place)[0]
        layout, at = ("QQQQ", place + 8) if wide else ("IIII", place + 4)
        offset, _, _, length = struct.unpack_from(order + layout, data, at)
        if kind == LOADED:
            yield offset + length
    yield sections + section_size * section_number


def _pe_ends(data: bytes) -> Iterator[int]:
    """Yields the ends of the sections."""
    start = struct.unpack_from("<I", data, 0x3C)[0]
    _, number, _, _, _, optional, _ = struct.unpack_from("<HHIIIHH", data, start + 4)
    for place in range(start + 24 + optional, start + 24 + optional + 40 * number, 40):
        size, offset = struct.unpack_from("<II", data, place + 16)
        yield offset + size


def _mach_ends(data: bytes, start: int) -> Iterator[int]:
    """Yields the ends of the segments."""
    number = struct.unpack_from("<I", data, start + 16)[0]
    place = start + 32
    for _ in range(number):
        kind, size = struct.unpack_from("<II", data, place)
        if kind == SEGMENT:
            offset, length = struct.unpack_from("<QQ", data, place + 40)
            yield start + offset + length
        if size == 0:
            raise ValueError("its header is damaged")
        place += size


def _fat_ends(data: bytes) -> Iterator[int]:
    """Yields the ends of a universal binary's parts."""
    number = struct.unpack_from(">I", data, 4)[0]
    for entry in range(min(number, 64)):
        offset, size = struct.unpack_from(">II", data, 8 + 20 * entry + 8)
        yield offset + size


def join_mach_o(slices: Sequence[bytes]) -> bytes:
    """Returns a universal file of 64-bit Mach-O files, one for each processor, as Apple's lipo.

    Layout (mach-o/fat.h, all big-endian): magic and number of slices; type and subtype of the
    processor, offset, size and alignment of each; the slices.
    """
    assert all(data.startswith(MACH) for data in slices), "not 64-bit Mach-O"
    head = bytearray(struct.pack(">4sI", FAT, len(slices)))
    offset, body = _aligned(len(head) + 20 * len(slices)), bytearray()
    start = offset
    for data in slices:
        processor = struct.unpack_from("<2I", data, len(MACH))
        head += struct.pack(">5I", *processor, offset, len(data), PAGE_BITS)
        body += bytes(offset - start - len(body)) + data
        offset = _aligned(offset + len(data))
    return bytes(head) + bytes(start - len(head)) + bytes(body)


def _aligned(offset: int) -> int:
    """Rounds an offset up to the alignment of slices."""
    return -(-offset >> PAGE_BITS) << PAGE_BITS
