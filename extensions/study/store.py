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
    SCENARIO_FACTOR,
    VALUES,
    Factor,
    RunResult,
    Study,
    StudyError,
    Value,
)

RUNS = "runs.sqlite"  # its name in the study's folder
FIGURES = tuple(name for name in METRICS if name != "realtime_factor")  # not of the machine
WALL = "wall"
WARNING_SEPARATOR = " | "
INTEGER, REAL, TEXT, BOOLEAN = "INTEGER", "REAL", "TEXT", "BOOLEAN"
FLUSH_ROWS, FLUSH_SECONDS = 1024, 2.0  # a killed process loses no more than this
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
        *(Column(factor.name, _kind_of(factor), factor.shown_unit) for factor in factors),
        Column("seed", INTEGER),
        *(Column(name, TEXT) for name in ("control", "status", "reason")),
        *(Column(name, BOOLEAN) for name in ("upright", "walked")),
        Column("fallback", REAL),
        Column("warnings", TEXT),
        *(Column(name, REAL, METRICS[name][0]) for name in FIGURES),
        Column(WALL, REAL, "s"),
    ]


def _kind_of(factor: Factor) -> str:
    first = factor.values[0] if factor.kind == VALUES else 0.0  # all values are of one kind
    return BOOLEAN if isinstance(first, bool) else TEXT if isinstance(first, str) else REAL


def row_of(result: RunResult, study: Study) -> list[Any]:
    """Returns the row of a run: its values in the order of the columns."""
    order, summary = result.order, result.summary
    values: list[Value | None] = [
        value
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
        result.wall,
    ]


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
        marks = ", ".join("?" * len(self.columns))
        with self._explained(), self.database:
            self.database.executemany(f"INSERT OR REPLACE INTO runs VALUES ({marks})", rows)

    def done(self, count: int) -> NDArray[np.bool_]:
        """Returns which of `count` runs are stored, as an array (count,)."""
        found = np.zeros(count, dtype=np.bool_)
        for (run,) in self.select("SELECT run FROM runs"):
            found[run] = True
        return found

    def select(self, text: str, values: Sequence[Any] = ()) -> list[tuple[Any, ...]]:
        """Returns the rows of a query."""
        with self._explained():
            return self.database.execute(text, values).fetchall()

    def close(self) -> None:
        """Closes the file."""
        self.database.close()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Raises StudyError for an error of SQLite: a full disk, or a file that is damaged."""
        try:
            yield
        except sqlite3.DatabaseError as error:
            full = getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_FULL
            raise StudyError(
                "the disk is full" if full else "damaged results, or a file that cannot be used",
                got=str(error),
                fix="make room and start the study again: it goes on, all stored runs are kept"
                if full
                else "remove the file and start the study again: its runs are run again",
                where=str(self.path),
            ) from error


def quoted(name: str) -> str:
    """Returns a name as SQL has it."""
    return '"' + name.replace('"', '""') + '"'
