"""Parts of a study's store: Parquet files that are never changed, whose names hold their number
and the checksum of their bytes.
"""

from __future__ import annotations

import io
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hexapod_cosim.cosim.study.plan.records import StudyError

SMALL, MERGED = "part", "merged"
RUN = "run"  # the column that they are sorted by
COMPRESSION = "zstd"
DAMAGED = ".damaged"  # ends the name of one that was set aside
NAME = re.compile(rf"({SMALL}|{MERGED})-([0-9]{{8,}})-([0-9a-f]{{8}})\.parquet")


class DamagedPartError(StudyError):
    """A part that is not what was written."""


def part_of(table: pa.Table, *, kind: str, number: int) -> tuple[str, bytes]:
    """A part's name and content."""
    buffer = io.BytesIO()
    pq.write_table(table.sort_by(RUN), buffer, compression=COMPRESSION)
    content = buffer.getvalue()
    return f"{kind}-{number:08d}-{_checksum(content)}.parquet", content


def parts_in(folder: Path, *, kind: str = "") -> list[Path]:
    """The parts in a folder, of one kind or of all, in the order of their numbers."""
    found = [
        path
        for path in folder.glob("*.parquet")
        if (match := NAME.fullmatch(path.name)) and kind in ("", match[1])
    ]
    return sorted(found, key=number_of)


def number_of(path: Path) -> int:
    """A part's number."""
    match = NAME.fullmatch(path.name)
    assert match is not None  # one of parts_in
    return int(match[2])


def read_part(path: Path, schema: pa.Schema, columns: Sequence[str] | None = None) -> pa.Table:
    """A part, or columns of it. Raises FileNotFoundError when it is gone, DamagedPartError,
    StudyError when it cannot be read.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        fix = "see that it can be read"
        raise StudyError(
            "cannot read a part of the results", got=error.strerror, fix=fix, where=str(path)
        ) from error
    if _checksum(content) != path.stem[-8:]:
        raise damaged(path, f"{len(content)} bytes that are not those that were written")
    try:
        file = pq.ParquetFile(pa.BufferReader(content))
        if file.schema_arrow.equals(schema):
            return file.read(columns=columns)
    except (pa.ArrowException, OSError) as error:
        raise damaged(path, str(error)) from error
    raise damaged(path, "columns of something else")


def runs_of(path: Path, schema: pa.Schema) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """The numbers of a part's runs, in order. Raises as `read_part` does."""
    runs: np.ndarray[tuple[int], np.dtype[np.int64]] = read_part(path, schema, [RUN])[
        RUN
    ].to_numpy()
    return runs


def damaged(path: Path, why: str) -> DamagedPartError:
    """The error for a part that is not what was written."""
    fix = "start the study again: it sets the part aside and runs its runs again"
    return DamagedPartError(
        "a damaged part of the results",
        got=why,
        expected="the Parquet file that was stored",
        fix=fix,
        where=str(path),
    )


def _checksum(content: bytes) -> str:
    return f"{zlib.crc32(content):08x}"
