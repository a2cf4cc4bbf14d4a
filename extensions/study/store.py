"""The store of a study's runs: a table of SQLite with a row a run, whose key is the run's number.

SQLite's transactions keep the table whole when the program is killed or loses power, and let other
processes read it while a study runs.
"""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexapod_cosim.cosim.results.metric_table import METRICS
from hexapod_cosim.extensions.study.records import (
    GAINS,
    SCENARIO_FACTOR,
    VALUES,
    Factor,
    RunResult,
    Study,
    StudyError,
    Value,
)
from hexapod_cosim.extensions.study.runs import identity

RUNS = "runs.sqlite"  # its name in the study's folder
MACHINE_METRIC = "realtime_factor"  # depends on the machine
FIGURES = tuple(name for name in METRICS if name != MACHINE_METRIC)
UNITS = {name: unit for name, (unit, _, _) in METRICS.items()}
WALL = "wall"
WARNING_SEPARATOR = " | "
INTEGER, REAL, TEXT, BOOLEAN = "INTEGER", "REAL", "TEXT", "BOOLEAN"
FLUSH_ROWS, FLUSH_SECONDS = 1024, 2.0  # a killed process loses no more than this
ROWS_AT_ONCE = 16_384  # rows that are read into memory at a time
BUSY_TIMEOUT = 60.0  # s    for another process that reads or writes

sqlite3.register_converter(BOOLEAN, lambda text: text == b"1")


@dataclass(frozen=True)
class Column:
    """A column of the table."""

    name: str
    kind: str  # INTEGER, REAL, TEXT or BOOLEAN
    unit: str = ""


def columns_of(study: Study) -> list[Column]:
    """Returns the columns of a study. A scenario that is a factor is in the column `case`."""
    factors = [factor for factor in study.factors if factor.name != SCENARIO_FACTOR]
    return [
        Column("run", f"{INTEGER} PRIMARY KEY"),
        Column("point", INTEGER),
        Column("case", TEXT),
        *(Column(factor.name, _kind_of(factor), _unit_of(factor)) for factor in factors),
        Column("seed", INTEGER),
        *(Column(name, TEXT) for name in ("control", "status", "reason")),
        *(Column(name, BOOLEAN) for name in ("upright", "walked")),
        Column("fallback", REAL),
        Column("warnings", TEXT),
        *(Column(name, REAL, UNITS[name]) for name in FIGURES),
        Column("identity", TEXT),
        Column(WALL, REAL, "s"),
    ]


def _unit_of(factor: Factor) -> str:
    return "designed gain" if factor.name.startswith(GAINS) and factor.relative else factor.unit


def _kind_of(factor: Factor) -> str:
    kinds = {type(value) for value in factor.values} if factor.kind == VALUES else {float}
    if kinds == {bool}:
        return BOOLEAN
    return REAL if kinds <= {int, float} else TEXT


def row_of(result: RunResult, study: Study) -> list[Any]:
    """Returns the row of a run: its values in the order of the columns."""
    order, summary = result.order, result.summary
    values = [
        _cell(factor, value)
        for factor, value in zip(study.factors, order.values, strict=True)
        if factor.name != SCENARIO_FACTOR
    ]
    figures = [summary.metrics[name] for name in FIGURES]
    return [
        order.run,
        order.point,
        order.case,
        *values,
        order.seed,
        order.control,
        summary.status,
        summary.reason,
        bool(summary.upright),
        bool(summary.walked),
        summary.fallback,
        WARNING_SEPARATOR.join(summary.warnings),
        *(float(value) if math.isfinite(value) else None for value in figures),
        identity(order, study.factors),
        result.wall,
    ]


def _cell(factor: Factor, value: Value | None) -> Value | None:
    """Converts the value of a factor to the type of its column."""
    if value is None or _kind_of(factor) == BOOLEAN:
        return value
    if _kind_of(factor) == TEXT:
        return str(value).lower() if isinstance(value, bool) else str(value)
    return float(value)


class Store:
    """The table of a study's folder, which is made when it is not there.

    Its methods raise StudyError when the disk is full or the file is damaged.
    """

    def __init__(self, folder: Path, study: Study) -> None:
        self.path, self._study, self.columns = folder / RUNS, study, columns_of(study)
        self._rows: list[list[Any]] = []
        self._flushed = monotonic()
        columns = ", ".join(f"{quoted(item.name)} {item.kind}" for item in self.columns)
        with self._explained():
            self.database = sqlite3.connect(
                self.path, timeout=BUSY_TIMEOUT, detect_types=sqlite3.PARSE_DECLTYPES
            )
            with self.database:
                self.database.execute(f"CREATE TABLE IF NOT EXISTS runs ({columns})")

    def add(self, results: Iterable[RunResult]) -> None:
        """Adds results, which are on the disk within FLUSH_SECONDS if more results follow."""
        self._rows.extend(row_of(result, self._study) for result in results)
        if len(self._rows) >= FLUSH_ROWS or monotonic() - self._flushed >= FLUSH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Writes the added rows to the disk.

        When this fails the rows are lost; their runs are run again when the study is resumed.
        """
        rows, self._rows, self._flushed = self._rows, [], monotonic()
        if rows:
            marks = ", ".join("?" * len(self.columns))
            with self._explained(), self.database:
                self.database.executemany(f"INSERT OR REPLACE INTO runs VALUES ({marks})", rows)

    def done(self, count: int) -> NDArray[np.bool_]:
        """Returns which of `count` runs are stored, as an array (count,)."""
        found = np.zeros(count, dtype=np.bool_)
        for (run,) in self.select("SELECT run FROM runs"):
            found[run] = True
        return found

    def numbers(self, first: int, end: int) -> set[int]:
        """Returns the numbers of the stored runs from `first` to before `end`."""
        rows = self.select("SELECT run FROM runs WHERE run >= ? AND run < ?", (first, end))
        return {run for (run,) in rows}

    def tables(self, columns: Sequence[Column]) -> Iterator[list[tuple[Any, ...]]]:
        """Yields the columns of all runs in the order of their numbers, some rows at a time."""
        names, begin = ", ".join(quoted(item.name) for item in columns), -1
        text = f"SELECT run, {names} FROM runs WHERE run > ? ORDER BY run LIMIT {ROWS_AT_ONCE}"
        while rows := self.select(text, (begin,)):
            begin = rows[-1][0]
            yield [row[1:] for row in rows]

    def select(self, text: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """Returns the rows of a query."""
        with self._explained():
            return self.database.execute(text, values).fetchall()

    def close(self) -> None:
        """Closes the file."""
        self.database.close()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Raises StudyError for an error of SQLite."""
        try:
            yield
        except sqlite3.DatabaseError as error:
            raise _study_error(error, self.path) from error


def quoted(name: str) -> str:
    """Returns a name as SQL has it."""
    return '"' + name.replace('"', '""') + '"'


def _study_error(error: sqlite3.DatabaseError, path: Path) -> StudyError:
    """Returns the error for an error of SQLite."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    if code in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR):
        return StudyError(
            "the disk is full or fails",
            got=str(error),
            expected="room for the results",
            fix="make room and start the study again: it goes on, all runs stored so far are kept",
            where=str(path.parent),
        )
    return StudyError(
        "damaged results, or a file that cannot be used",
        got=str(error),
        expected="the file that was stored",
        fix="check its rights, or remove it and start the study again: its runs are run again",
        where=str(path),
    )
