"""Small studies with engines that simulate no walk."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from hexapod_cosim.cosim.study.execute.study import Options, run_study
from hexapod_cosim.cosim.study.plan.reading import study_from_table
from hexapod_cosim.cosim.study.plan.records import Study
from hexapod_cosim.cosim.study.store.columns import schema_of
from hexapod_cosim.cosim.study.store.manifest import RESULTS, RUNS
from hexapod_cosim.cosim.study.store.store import Store

FAKE, SLOW, BRIEF = "study_engines:Fake", "study_engines:Slow", "study_engines:Brief"
LEAKY = "study_engines:Leaky"
SMALL: dict[str, Any] = {
    "scenario": "walk_flat",
    "seeds": 3,
    "factors": {"friction.mu": [0.3, 0.6, 0.9]},
}
KINEMATIC = {"controls": ["kinematic"]}


def study_of(table: Mapping[str, Any] = SMALL, **changes: Any) -> Study:
    return study_from_table({**table, **changes}, where="test.toml")


def quiet(_total: int, _done: int) -> Any:
    """Starts no display of progress."""
    return lambda _more, _lost: None


def run_quietly(study: Study, folder: Path, **options: Any) -> list[dict[str, Any]]:
    """Runs a study without a display of progress; returns the rows of its results."""
    run_study(
        study, folder, options=Options(**{"engine": FAKE, "workers": 0, **options}), start=quiet
    )
    return rows(folder)


def rows(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = pq.read_table(folder / RESULTS).to_pylist()
    return found


def digest(folder: Path) -> str:
    """Returns the SHA-256 of the results."""
    return hashlib.sha256((folder / RESULTS).read_bytes()).hexdigest()


def replace_stored(
    study: Study, folder: Path, change: Callable[[dict[str, Any]], dict[str, Any] | None]
) -> None:
    """Replaces each stored row by the result of `change`, or removes it for None."""
    store = Store(folder / RUNS, schema_of(study))
    stored = [row for table in store.sorted_rows() for row in table.to_pylist()]
    for part in store.parts():
        part.unlink()
    store.add(row for row in map(change, stored) if row is not None)
    store.flush()
