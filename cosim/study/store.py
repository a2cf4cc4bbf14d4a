"""Where runs are kept as they come: Parquet parts in a folder, each written whole, flushed to the disk and renamed into place.

A part is never changed. Many small ones are put together into one, written before they are taken away; a run that stands in two parts
is the same in both. So a folder is valid whenever the power goes.
"""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from hexapod_cosim.cosim.files import not_writable
from hexapod_cosim.cosim.study.records import StudyError

SMALL, MERGED = "part", "merged"  # names of parts
MANY = 64  # small parts are put together
ROWS_AT_ONCE = 16_384  # in memory, of the whole
FLUSH_ROWS, FLUSH_SECONDS = 1024, 2.0  # no more than this is lost to a kill
COMPRESSION = "zstd"
RUN = "run"

Writer = Callable[[Path, bytes], None]


def write_durably(path: Path, content: bytes) -> None:
    """Writes a file whole or not at all, on the disk when this returns. Raises StudyError when the disk is full, HexapodError else."""
    part = path.with_name(f".{path.name}.new")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
        _sync_folder(path.parent)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise _not_written(path, error) from error


def _sync_folder(folder: Path) -> None:
    """The rename itself, too; Windows has no such thing."""
    if hasattr(os, "O_DIRECTORY"):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _not_written(path: Path, error: OSError) -> Exception:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        fix = "make room and start the study again: it goes on, all runs stored so far are kept"
        return StudyError("the disk is full", got=error.strerror, expected="room for the results", fix=fix, where=str(path.parent))
    return not_writable(path, error)


class Store:
    """The parts of a study's folder. `schema` is that of all of them; its first column is the run's number."""

    def __init__(self, folder: Path, schema: pa.Schema, *, write: Writer = write_durably) -> None:
        self._folder, self._schema, self._write = folder, schema, write
        self._next = 1 + max((int(path.stem.rpartition("-")[2]) for path in self.parts()), default=-1)
        self._rows: list[dict[str, object]] = []
        self._flushed = monotonic()

    def prepare(self) -> None:
        """Makes the folder, and takes away what a killed study left half written."""
        try:
            self._folder.mkdir(exist_ok=True)
            for left in self._folder.glob(".*.new"):
                left.unlink()
        except OSError as error:
            raise _not_written(self._folder, error) from error

    def parts(self) -> list[Path]:
        """All parts, in the order of their numbers."""
        return sorted(
            [*self._folder.glob(f"{SMALL}-*.parquet"), *self._folder.glob(f"{MERGED}-*.parquet")], key=lambda path: path.stem[-8:]
        )

    def add(self, rows: Iterable[dict[str, object]]) -> None:
        """Keeps rows; they are on the disk within FLUSH_SECONDS, if more come. Raises StudyError when the disk is full."""
        self._rows.extend(rows)
        if len(self._rows) >= FLUSH_ROWS or monotonic() - self._flushed >= FLUSH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Puts what was added on the disk. Raises StudyError when it is full: the rows are then lost, and run again another time."""
        rows, self._rows, self._flushed = self._rows, [], monotonic()
        if rows:
            self._write_part(SMALL, pa.Table.from_pylist(rows, schema=self._schema))
            self._put_together()

    def _write_part(self, kind: str, table: pa.Table) -> None:
        self._write(self._folder / f"{kind}-{self._next:08d}.parquet", _parquet(table.sort_by(RUN)))
        self._next += 1

    def _put_together(self) -> None:
        small = sorted(self._folder.glob(f"{SMALL}-*.parquet"))
        if len(small) >= MANY:
            self._write_part(MERGED, pa.concat_tables(map(self._read, small)))
            for path in small:
                path.unlink()

    def _read(self, path: Path, columns: Sequence[str] | None = None) -> pa.Table:
        try:
            table = pq.read_table(path, columns=columns, partitioning=None, memory_map=False)
        except (pa.ArrowException, OSError) as error:
            fix = "delete it: its runs are run again"
            raise StudyError("a damaged part of the results", got=str(error), expected="Parquet", fix=fix, where=str(path)) from error
        return table

    def done(self, count: int) -> NDArray[np.bool_]:
        """(count,) which runs are stored: a byte each. Raises StudyError for a part that cannot be read."""
        found = np.zeros(count, dtype=np.bool_)
        for path in self.parts():
            runs = self._read(path, [RUN])[RUN].to_numpy()
            found[runs[runs < count]] = True
        return found

    def rows(self, runs: Sequence[int]) -> dict[int, dict[str, Any]]:
        """Stored rows of some runs, by number."""
        found: dict[int, dict[str, Any]] = {}
        for path in self.parts() if runs else ():
            low, high = _range(path)
            if low <= max(runs) and high >= min(runs):
                found |= {row[RUN]: row for row in pq.read_table(path, filters=[(RUN, "in", list(runs))], partitioning=None).to_pylist()}
        return found

    def sorted_rows(self) -> Iterator[pa.Table]:
        """All runs once, in the order of their numbers, some ten thousand at a time."""
        parts = self.parts()
        ranges = [_range(path) for path in parts]
        end = 1 + max((high for _, high in ranges), default=-1)
        for begin in range(0, end, ROWS_AT_ONCE):
            stop = begin + ROWS_AT_ONCE
            block = [path for path, (low, high) in zip(parts, ranges, strict=True) if low < stop and high >= begin]
            filters = [(RUN, ">=", begin), (RUN, "<", stop)]
            tables = [pq.read_table(path, filters=filters, partitioning=None, schema=self._schema) for path in block]
            table = pa.concat_tables(tables).sort_by(RUN) if tables else self._schema.empty_table()
            runs = table[RUN].to_numpy()
            yield table.filter(pa.array(np.append(True, runs[1:] != runs[:-1])[: len(runs)]))


def _range(path: Path) -> tuple[int, int]:
    """The first and the last run of a part, which is sorted, from its footer."""
    groups = pq.ParquetFile(path).metadata
    if not groups.num_rows:
        return 0, -1
    column = groups.schema.names.index(RUN)
    statistics = [groups.row_group(k).column(column).statistics for k in range(groups.num_row_groups)]
    return min(item.min for item in statistics), max(item.max for item in statistics)


def _parquet(table: pa.Table) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression=COMPRESSION)
    return buffer.getvalue()


def write_whole(path: Path, tables: Iterable[pa.Table], schema: pa.Schema) -> None:
    """One Parquet file of tables, whole or not at all: the same bytes for the same rows. Raises StudyError when the disk is full."""
    part = path.with_name(f".{path.name}.new")
    try:
        with part.open("wb") as file:
            with pq.ParquetWriter(file, schema, compression=COMPRESSION) as writer:
                for table in tables:
                    writer.write_table(table.select(schema.names).cast(schema))
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise _not_written(path, error) from error
