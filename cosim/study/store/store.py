"""The store of a study's runs: Parquet parts in a folder.

Each part is written completely, flushed to the disk and renamed to its name, and is never changed.
Many small parts are merged into one, which is written before the small ones are removed; a run
that is in two parts is the same in both. So the folder is valid at any time, also after a power
failure, and may be read while a study runs. A part that is damaged all the same is set aside, and
its runs are run again.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic
from typing import Any, BinaryIO
from uuid import uuid4

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.events import EventSink, ignore_event
from hexapod_cosim.cosim.common.files import flush_folder, not_writable
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.cosim.study.store.parts import (
    COMPRESSION,
    DAMAGED,
    MERGED,
    RUN,
    SMALL,
    DamagedPartError,
    damaged,
    number_of,
    part_of,
    parts_in,
    read_part,
    runs_of,
)

MERGE_COUNT = 64  # small parts that are merged into one
ROWS_AT_ONCE = 16_384  # rows that are read into memory at a time
FLUSH_ROWS, FLUSH_SECONDS = 1024, 2.0  # a killed process loses no more than this
MAX_RETRIES = 100  # of reading parts that a running study merges meanwhile
UNFINISHED = ".*.new"  # files that are being written, or whose writer was killed

Writer = Callable[[Path, bytes], None]


def write_durably(path: Path, content: bytes) -> None:
    """Writes a file completely or not at all; it is on the disk when this function returns.

    Raises StudyError when the disk is full, HexapodError when the file cannot be written.
    """
    with _durable_file(path) as file:
        file.write(content)


def write_whole(path: Path, tables: Iterable[pa.Table], schema: pa.Schema) -> None:
    """Writes tables to one Parquet file as write_durably() does. The same rows give the same bytes.

    Raises as write_durably() does.
    """
    with (
        _durable_file(path) as file,
        pq.ParquetWriter(file, schema, compression=COMPRESSION) as writer,
    ):
        for table in tables:
            writer.write_table(table.select(schema.names).cast(schema))


@contextmanager
def _durable_file(path: Path) -> Iterator[BinaryIO]:
    """Yields a file that is flushed to the disk and replaces `path` when the block succeeds."""
    part = _unfinished(path)
    try:
        with part.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
        flush_folder(path.parent)
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        part.unlink(missing_ok=True)


def _unfinished(path: Path) -> Path:
    """Returns the path of a file while it is written, which is another one for each writer."""
    return path.with_name(f".{path.name}.{uuid4().hex[:8]}.new")


def _not_written(path: Path, error: OSError) -> Exception:
    """Returns the error for a file that could not be written."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        fix = "make room and start the study again: it goes on, all runs stored so far are kept"
        return StudyError(
            "the disk is full",
            got=error.strerror,
            expected="room for the results",
            fix=fix,
            where=str(path.parent),
        )
    return not_writable(path, error)


class Store:
    """The parts in a study's folder.

    Args:
        folder: folder of the parts.
        schema: the schema of all parts.
        write: function that writes a file durably.
    """

    def __init__(self, folder: Path, schema: pa.Schema, *, write: Writer = write_durably) -> None:
        self._folder, self._schema, self._write = folder, schema, write
        self._next = 1 + max((number_of(path) for path in self.parts()), default=-1)
        self._ranges: dict[Path, tuple[int, int]] = {}
        self._skipped: dict[Path, DamagedPartError] = {}
        self._rows: list[dict[str, object]] = []
        self._flushed = monotonic()

    def prepare(self, count: int, *, events: EventSink = ignore_event) -> None:
        """Makes the folder for `count` runs, or recovers it after a study was killed.

        Unfinished files are removed, and damaged parts are set aside with a message to `events`.
        """
        try:
            self._folder.mkdir(exist_ok=True)
            for path in self._folder.glob(UNFINISHED):
                path.unlink()
            for path in self.parts():
                self._check_part(path, count, events)
        except OSError as error:
            raise _not_written(self._folder, error) from error

    def _check_part(self, path: Path, count: int, events: EventSink) -> None:
        """Renames a part that is damaged or holds runs of another study."""
        try:
            runs = runs_of(path, self._schema)
            if len(runs) and not 0 <= runs[0] <= runs[-1] < count:
                raise damaged(path, f"runs {runs[0]} to {runs[-1]} of {count}")
        except DamagedPartError as error:
            aside = path.with_name(path.name + DAMAGED)
            os.replace(path, aside)
            events(
                f"{path}: {error.what} ({error.got}): "
                f"set aside as {aside.name}, its runs are run again"
            )

    def parts(self) -> list[Path]:
        """Returns all parts in the order of their numbers."""
        return parts_in(self._folder)

    def add(self, rows: Iterable[dict[str, object]]) -> None:
        """Adds rows, which are on the disk within FLUSH_SECONDS if more rows follow.

        Raises StudyError when the disk is full.
        """
        self._rows.extend(rows)
        if len(self._rows) >= FLUSH_ROWS or monotonic() - self._flushed >= FLUSH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Writes the added rows to the disk.

        Raises StudyError when the disk is full. The rows are lost then; their runs are run again
        when the study is resumed.
        """
        rows, self._rows, self._flushed = self._rows, [], monotonic()
        if rows:
            self._write_part(SMALL, pa.Table.from_pylist(rows, schema=self._schema))
            self._merge_parts()

    def _write_part(self, kind: str, table: pa.Table) -> None:
        name, content = part_of(table, kind=kind, number=self._next)
        self._write(self._folder / name, content)
        self._next += 1

    def _merge_parts(self) -> None:
        small = parts_in(self._folder, kind=SMALL)
        if len(small) >= MERGE_COUNT:
            tables = [read_part(path, self._schema) for path in small]
            self._write_part(MERGED, pa.concat_tables(tables))
            for path in small:
                # on Windows a part that is being read stays: its runs are in two parts then
                with suppress(PermissionError):
                    path.unlink()

    def done(self, count: int) -> NDArray[np.bool_]:
        """Returns which of `count` runs are stored, as an array (count,).

        Raises StudyError for a part that cannot be read.
        """
        found = np.zeros(count, dtype=np.bool_)
        for path in self.parts():
            found[runs_of(path, self._schema)] = True
        return found

    def rows(self, runs: Sequence[int]) -> dict[int, dict[str, Any]]:
        """Returns the rows of those of the given runs that are stored, by run number."""
        found: dict[int, dict[str, Any]] = {}
        for path in self.parts() if runs else ():
            low, high = self._range(path)
            if low <= max(runs) and high >= min(runs):
                table = read_part(path, self._schema)
                found |= {
                    row[RUN]: row
                    for row in table.filter(pc.field(RUN).isin(list(runs))).to_pylist()
                }
        return found

    def skip_damaged(self) -> list[str]:
        """Leaves damaged parts out of sorted_rows() from now on, and returns descriptions of them.

        The files are not changed.
        """
        for path in self.parts():
            try:
                self._range(path)
            except FileNotFoundError:  # a running study has merged it with others
                continue
            except DamagedPartError as error:
                self._skipped[path] = error
        return [f"{path.name} ({error.got})" for path, error in self._skipped.items()]

    def sorted_rows(self) -> Iterator[pa.Table]:
        """Yields each run once, in the order of their numbers, ROWS_AT_ONCE numbers at a time.

        Raises StudyError for parts that cannot be read or keep vanishing.
        """
        begin, retries = 0, 0
        while True:
            try:
                ranges = {
                    path: self._range(path)
                    for path in self._settled_parts()
                    if path not in self._skipped
                }
                if begin > max((high for _, high in ranges.values()), default=-1):
                    return
                table = self._block(begin, begin + ROWS_AT_ONCE, ranges)
            except FileNotFoundError as error:  # a running study has merged it with others
                retries += 1
                if retries > MAX_RETRIES:
                    raise StudyError(
                        "parts of the results vanish", got=str(error.filename), fix="try again"
                    ) from error
                continue
            yield table
            begin, retries = begin + ROWS_AT_ONCE, 0

    def _settled_parts(self) -> list[Path]:
        """Returns all parts, after two equal listings.

        A listing during which parts are merged may hold neither the small parts nor the merged
        one.
        """
        before, now = None, self.parts()
        while now != before:
            before, now = now, self.parts()
        return now

    def _block(self, begin: int, stop: int, ranges: Mapping[Path, tuple[int, int]]) -> pa.Table:
        """Returns the runs from `begin` to before `stop`. Raises FileNotFoundError."""
        place = pc.field(RUN)
        paths = [path for path, (low, high) in ranges.items() if low < stop and high >= begin]
        tables = [
            read_part(path, self._schema).filter((place >= begin) & (place < stop))
            for path in paths
        ]
        table = pa.concat_tables(tables).sort_by(RUN) if tables else self._schema.empty_table()
        runs = table[RUN].to_numpy()
        return table.filter(pa.array(np.append(True, runs[1:] != runs[:-1])[: len(runs)]))

    def _range(self, path: Path) -> tuple[int, int]:
        """Returns the first and the last run of a part; (0, -1) for an empty one."""
        if path not in self._ranges:
            runs = runs_of(path, self._schema)
            self._ranges[path] = (int(runs[0]), int(runs[-1])) if len(runs) else (0, -1)
        return self._ranges[path]
