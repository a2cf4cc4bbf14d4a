"""Joins Mach-O libraries for several processors into one universal file, as Apple's lipo does."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from hexapod_cosim.cosim.common.binaries import FAT, MACH
from hexapod_cosim.models.errors import FmuError

PAGE_BITS = 14  # slices begin at multiples of 16 KiB, the larger of the processors' pages
_HEADER, _SLICE, _PROCESSOR = struct.Struct(">4sI"), struct.Struct(">5I"), struct.Struct("<2I")


def join_mach_o(slices: Sequence[bytes]) -> bytes:
    """Returns a universal file of 64-bit Mach-O files, one for each processor.

    Layout (mach-o/fat.h, all big-endian): magic and number of slices; processor, subtype, offset,
    size and alignment of each; the slices. Raises FmuError when one is no such file, or two are for
    the same processor.
    """
    processors = [_processor(data) for data in slices]
    if len(set(processors)) < len(processors):
        raise FmuError(
            "universal binary",
            got=f"processors {processors}",
            expected="each once",
            fix="join one file a processor",
        )
    out = bytearray(_HEADER.pack(FAT, len(slices)))
    offset = _aligned(_HEADER.size + _SLICE.size * len(slices))
    for processor, data in zip(processors, slices, strict=True):
        out += _SLICE.pack(*processor, offset, len(data), PAGE_BITS)
        offset = _aligned(offset + len(data))
    for data in slices:
        out += bytes(_aligned(len(out)) - len(out)) + data
    return bytes(out)


def _processor(data: bytes) -> tuple[int, int]:
    """Returns type and subtype of a Mach-O file's processor. Raises FmuError for other files."""
    if not data.startswith(MACH):
        raise FmuError(
            "universal binary",
            got=f"a file that begins with {data[:4].hex()}",
            expected="64-bit Mach-O",
            fix="build it for macOS",
        )
    kind, subtype = _PROCESSOR.unpack_from(data, len(MACH))
    return kind, subtype


def _aligned(offset: int) -> int:
    """Rounds an offset up to the alignment of slices."""
    return -(-offset >> PAGE_BITS) << PAGE_BITS
