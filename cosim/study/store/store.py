"""Where runs are kept as they come: Parquet parts in a folder, each written whole, flushed to the
disk and renamed into place.

A part is never changed. Many small ones are put together into one, written before they are taken
away; a run that stands in two parts is the same in both. So a folder is valid whenever the power
goes, and may be read while a study runs. A part that is damaged all the same is set aside, and its
runs are run again.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any
from uuid import uuid4

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from hexapod_cosim.cosim.common.events import EventSink, ignore_event
from hexapod_cosim.cosim.common.files import not_writable
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

MANY = 64  # small parts are put together
ROWS_AT_ONCE = 16_384  # in memory, of the whole
FLUSH_ROWS, FLUSH_SECONDS = 1024, 2.0  # no more than this is lost to a kill
MOST_LOOKS = (
    100  # for parts that vanish while they are read, because a running study puts them together
)
# half-written files of processes that were killed, or files that others write just now
LEFTOVERS = ".*.new"

Writer = Callable[[Path, bytes], None]


def write_durably(path: Path, content: bytes) -> None:
    """Writes a file whole or not at all, on the disk when this returns. Raises StudyError when
    the disk is full, HexapodError else.
    """
    part = _unfinished(path)
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
        _sync_folder(path.parent)
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        part.unlink(missing_ok=True)


def _unfinished(path: Path) -> Path:
    """Where a file is while it is written; each writer has its own."""
    return path.with_name(f".{path.name}.{uuid4().hex[:8]}.new")


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
        return StudyError(
            "the disk is full",
            got=error.strerror,
            expected="room for the results",
            fix=fix,
            where=str(path.parent),
        )
    return not_writable(path, error)


class Store:
    """The parts of a study's folder. `schema` is that of all of them."""

    def __init__(self, folder: Path, schema: pa.Schema, *, write: Writer = write_durably) -> None:
        self._folder, self._schema, self._write = folder, schema, write
        self._next = 1 + max((number_of(path) for path in self.parts()), default=-1)
        self._ranges: dict[Path, tuple[int, int]] = {}
        self._skipped: dict[Path, DamagedPartError] = {}
        self._rows: list[dict[str, object]] = []
        self._flushed = monotonic()

    def prepare(self, count: int, *, say: EventSink = ignore_event) -> None:
        """Makes the folder for `count` runs, takes away what a killed study left half written,
        and sets damaged parts aside.
        """
        try:
            self._folder.mkdir(exist_ok=True)
            for left in self._folder.glob(LEFTOVERS):
                left.unlink()
            for path in self.parts():
                self._judge(path, count, say)
        except OSError as error:
            raise _not_written(self._folder, error) from error

    def _judge(self, path: Path, count: int, say: EventSink) -> None:
        try:
            runs = runs_of(path, self._schema)
            if len(runs) and not 0 <= runs[0] <= runs[-1] < count:
                raise damaged(path, f"runs {runs[0]} to {runs[-1]} of {count}")
        except DamagedPartError as error:
            aside = path.with_name(path.name + DAMAGED)
            os.replace(path, aside)
            say(
                f"{path}: {error.what} ({error.got}): set aside as {aside.name}, its runs are run again"
            )

    def parts(self) -> list[Path]:
        """All parts, in the order of their numbers."""
        return parts_in(self._folder)

    def add(self, rows: Iterable[dict[str, object]]) -> None:
        """Keeps rows; they are on the disk within FLUSH_SECONDS, if more come. Raises StudyError
        when the disk is full.
        """
        self._rows.extend(rows)
        if len(self._rows) >= FLUSH_ROWS or monotonic() - self._flushed >= FLUSH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Puts what was added on the disk. Raises StudyError when it is full: the rows are then
        lost, and run again another time.
        """
        rows, self._rows, self._flushed = self._rows, [], monotonic()
        if rows:
            self._write_part(SMALL, pa.Table.from_pylist(rows, schema=self._schema))
            self._put_together()

    def _write_part(self, kind: str, table: pa.Table) -> None:
        name, content = part_of(table, kind=kind, number=self._next)
        self._write(self._folder / name, content)
        self._next += 1

    def _put_together(self) -> None:
        small = parts_in(self._folder, kind=SMALL)
        if len(small) >= MANY:
            self._write_part(
                MERGED, pa.concat_tables(read_part(path, self._schema) for path in small)
            )
            for path in small:
                with suppress(
                    PermissionError
                ):  # somebody reads it on Windows: it stays, with runs that stand twice
                    path.unlink()

    def done(self, count: int) -> NDArray[np.bool_]:
        """(count,) which runs are stored: a byte each. Raises StudyError for a part that cannot
        be read.
        """
        found = np.zeros(count, dtype=np.bool_)
        for path in self.parts():
            found[runs_of(path, self._schema)] = True
        return found

    def rows(self, runs: Sequence[int]) -> dict[int, dict[str, Any]]:
        """Stored rows of some runs, by number."""
        found: dict[int, dict[str, Any]] = {}
        for path in self.parts() if runs else ():
            low, high = self._range(path)
            if low <= max(runs) and high >= min(runs):
                table = read_part(path, self._schema)
                found |= {
                    row[RUN]: row
                    for row in table.filter(pa.compute.field(RUN).isin(list(runs))).to_pylist()
                }
        return found

    def skip_damaged(self) -> list[str]:
        """Leaves damaged parts out of `sorted_rows` from now on, and says in words which they
        are. They stay where they are.
        """
        for path in self.parts():
            try:
                self._range(path)
            except FileNotFoundError:  # a running study put it together with others
                continue
            except DamagedPartError as error:
                self._skipped[path] = error
        return [f"{path.name} ({error.got})" for path, error in self._skipped.items()]

    def sorted_rows(self) -> Iterator[pa.Table]:
        """All runs once, in the order of their numbers, some ten thousand at a time."""
        begin, looks = 0, 0
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
            except (
                FileNotFoundError
            ) as error:  # a running study put parts together: what was in them is elsewhere now
                looks += 1
                if looks > MOST_LOOKS:
                    raise StudyError(
                        "parts of the results vanish", got=str(error.filename), fix="try again"
                    ) from error
                continue
            yield table
            begin, looks = begin + ROWS_AT_ONCE, 0

    def _settled_parts(self) -> list[Path]:
        """All parts, listed twice alike: a listing during which one came and others went may
        have neither.
        """
        before, now = None, self.parts()
        while now != before:
            before, now = now, self.parts()
        return now

    def _block(self, begin: int, stop: int, ranges: Mapping[Path, tuple[int, int]]) -> pa.Table:
        """The runs from `begin` to before `stop`. Raises FileNotFoundError."""
        place = pa.compute.field(RUN)
        paths = [path for path, (low, high) in ranges.items() if low < stop and high >= begin]
        tables = [
            read_part(path, self._schema).filter((place >= begin) & (place < stop))
            for path in paths
        ]
        table = pa.concat_tables(tables).sort_by(RUN) if tables else self._schema.empty_table()
        runs = table[RUN].to_numpy()
        return table.filter(pa.array(np.append(True, runs[1:] != runs[:-1])[: len(runs)]))

    def _range(self, path: Path) -> tuple[int, int]:
        if path not in self._ranges:
            runs = runs_of(path, self._schema)
            self._ranges[path] = (int(runs[0]), int(runs[-1])) if len(runs) else (0, -1)
        return self._ranges[path]


def write_whole(path: Path, tables: Iterable[pa.Table], schema: pa.Schema) -> None:
    """One Parquet file of tables, whole or not at all: the same bytes for the same rows. Raises
    StudyError when the disk is full.
    """
    part = _unfinished(path)
    try:
        with part.open("wb") as file:
            with pq.ParquetWriter(file, schema, compression=COMPRESSION) as writer:
                for table in tables:
                    writer.write_table(table.select(schema.names).cast(schema))
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise _not_written(path, error) from error
    finally:
        part.unlink(missing_ok=True)
