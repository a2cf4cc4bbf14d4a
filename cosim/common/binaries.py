"""Shared libraries: whether one of Linux is complete before the system maps it into this process,
and several of macOS as one.

Linux maps a library that was cut short all the same: the process then ends with SIGBUS when it
reaches a page behind the file's end. Other systems refuse to load such a file.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

from hexapod_cosim.models.errors import FmuError

# first bytes of libraries of Linux and macOS, and of several joined for macOS
ELF, MACH, FAT = b"\x7fELF", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe"
PAGE_BITS = 14  # slices begin at multiples of 16 KiB, the larger of the processors' pages
LOADED = 1  # PT_LOAD


def refuse_incomplete(path: str | Path) -> None:
    """Raises FmuError for a library of Linux that is cut short or damaged."""
    data = Path(path).read_bytes()
    if not data.startswith(ELF):
        return  # another system's, or none: the loader says so
    try:
        missing = max(max(_elf_ends(data)) - len(data), 0)
        problem = f"{missing} bytes are missing at its end" if missing else ""
    except (struct.error, IndexError):
        problem = "its header is cut short or damaged"
    if problem:
        raise FmuError(
            "the FMU's binary cannot be loaded",
            got=problem,
            expected="a complete library",
            fix="export the FMU again with `hexapod export`",
            where=Path(path).name,
        )


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
