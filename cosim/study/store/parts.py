"""Parts of a study's store: immutable Parquet files named by their number and checksum."""

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

SMALL, MERGED = "part", "merged"  # kinds of parts
RUN = "run"  # the column that parts are sorted by
COMPRESSION = "zstd"
DAMAGED = ".damaged"  # suffix of a part that was set aside
NAME = re.compile(rf"({SMALL}|{MERGED})-([0-9]{{8,}})-([0-9a-f]{{8}})\.parquet")


class DamagedPartError(StudyError):
    """A part whose content is not what was written."""


def part_of(table: pa.Table, *, kind: str, number: int) -> tuple[str, bytes]:
    """Returns the name and the content of the part that holds a table."""
    buffer = io.BytesIO()
    pq.write_table(table.sort_by(RUN), buffer, compression=COMPRESSION)
    content = buffer.getvalue()
    return f"{kind}-{number:08d}-{_checksum(content)}.parquet", content


def parts_in(folder: Path, *, kind: str = "") -> list[Path]:
    """Returns the parts in a folder, of one kind or of all, in the order of their numbers."""
    found = [
        path
        for path in folder.glob("*.parquet")
        if (match := NAME.fullmatch(path.name)) and kind in ("", match[1])
    ]
    return sorted(found, key=number_of)


def number_of(path: Path) -> int:
    """Returns the number of a part."""
    match = NAME.fullmatch(path.name)
    assert match is not None  # one of parts_in
    return int(match[2])


def read_part(path: Path, schema: pa.Schema, columns: Sequence[str] | None = None) -> pa.Table:
    """Reads a part, or some of its columns.

    Raises:
        FileNotFoundError: the part is gone.
        DamagedPartError: its content is damaged or has other columns.
        StudyError: it cannot be read.
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
    raise damaged(path, "the columns of another study")


def runs_of(path: Path, schema: pa.Schema) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Returns the numbers of a part's runs in ascending order. Raises as read_part() does."""
    runs: np.ndarray[tuple[int], np.dtype[np.int64]] = read_part(path, schema, [RUN])[
        RUN
    ].to_numpy()
    return runs


def damaged(path: Path, reason: str) -> DamagedPartError:
    """Returns the error for a damaged part."""
    fix = "start the study again: it sets the part aside and runs its runs again"
    return DamagedPartError(
        "a damaged part of the results",
        got=reason,
        expected="the Parquet file that was stored",
        fix=fix,
        where=str(path),
    )


def _checksum(content: bytes) -> str:
    return f"{zlib.crc32(content):08x}"
