"""Reads small files with a limit, so that no device and no huge file fills the memory."""

from __future__ import annotations

import errno
from pathlib import Path

LARGEST_FILE = 64 * 2**20  # bytes  of robots, scenarios, studies, gains, URDFs and JSON files
MAP_SIZE = 512 * 2**20  # bytes  of height maps and grids


def read_bytes(path: Path, limit: int = LARGEST_FILE) -> bytes:
    """Returns a file's content. Raises OSError, also for one of more than `limit` bytes."""
    with path.open("rb") as file:
        content = file.read(limit + 1)
    if len(content) > limit:
        raise OSError(errno.EFBIG, f"a file of more than {limit // 2**20} MiB", str(path))
    return content


def read_text(path: Path, *, encoding: str = "utf-8") -> str:
    """Returns the content of a text file, whose lines then end as on Unix.

    Raises OSError, also for more than LARGEST_FILE bytes, and UnicodeDecodeError.
    """
    text = read_bytes(path).decode(encoding)
    return text.replace("\r\n", "\n").replace("\r", "\n")
