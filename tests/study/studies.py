"""Small studies with runners that simulate no walk."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from study_runners import Fake

from hexapod_cosim.extensions.study.folder import RESULTS
from hexapod_cosim.extensions.study.job import Job, make_job
from hexapod_cosim.extensions.study.reading import study_from_table
from hexapod_cosim.extensions.study.records import Study
from hexapod_cosim.extensions.study.run import Options, run_study
from hexapod_cosim.extensions.study.store import RUNS, Store, quoted

SMALL: dict[str, Any] = {
    "scenario": "walk_flat",
    "seeds": 3,
    "factors": {"friction.mu": [0.3, 0.6, 0.9]},
}
KINEMATIC = {"controls": ["kinematic"]}
Row = dict[str, Any]


def study_of(table: Mapping[str, Any] = SMALL, **changes: Any) -> Study:
    return study_from_table({**table, **changes}, where="test.toml")


def quiet(_total: int) -> Any:
    """Opens no display of progress."""
    return nullcontext(lambda _done, _failed: None)


def watched(act: Callable[[], object]) -> Any:
    """Returns a display of progress that calls `act` for each number of new results."""
    return lambda _total: nullcontext(lambda done, _failed: done and act())


def run_quietly(study: Study, folder: Path, **options: Any) -> list[Row]:
    """Runs a study without a display of progress; returns the rows of its results."""
    run_study(
        study, folder, options=Options(**{"runner": Fake, "workers": 0, **options}), progress=quiet
    )
    return rows(folder)


def rows(folder: Path) -> list[Row]:
    found: list[Row] = pq.read_table(folder / RESULTS).to_pylist()
    return found


def stored_rows(study: Study, folder: Path) -> list[Row]:
    """Returns the rows of the store, also of a study that runs, in the order of their numbers."""
    with closing(Store(folder, study)) as store:
        names = [item.name for item in store.columns]
        found = store.select("SELECT * FROM runs ORDER BY run")
        return [dict(zip(names, row, strict=True)) for row in found]


def stored_count(study: Study, folder: Path) -> int:
    """Returns the number of runs in the store; 0 where there is none."""
    return len(stored_rows(study, folder)) if (folder / RUNS).exists() else 0


def replace_stored(
    study: Study, folder: Path, change: Callable[[Row], Row | None] = lambda row: row
) -> None:
    """Replaces each stored row by the result of `change`, or removes it for None."""
    kept = [row for row in map(change, stored_rows(study, folder)) if row is not None]
    write_rows(study, folder, kept)


def write_rows(study: Study, folder: Path, found: Iterable[Row]) -> None:
    """Replaces all stored rows; what a row lacks is NULL."""
    with closing(Store(folder, study)) as store, store.database:
        names = [item.name for item in store.columns]
        store.database.execute("DELETE FROM runs")
        store.database.executemany(
            f"INSERT INTO runs ({', '.join(map(quoted, names))}) VALUES "
            f"({', '.join('?' * len(names))})",
            [[row.get(name) for name in names] for row in found],
        )


def use_runner(monkeypatch: pytest.MonkeyPatch, runner: type) -> None:
    """Makes commands run studies with a runner of the tests."""

    def make(*arguments: Any, **options: Any) -> Job:
        return make_job(*arguments, **{**options, "runner": runner})

    monkeypatch.setattr("hexapod_cosim.extensions.study.run.make_job", make)
