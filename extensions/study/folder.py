"""The folder of a study: the manifest, by which another study is refused, and the exported table.

results.parquet has all runs in the order of their numbers and is the same however they were run.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from hexapod_cosim.cosim.common.files import (
    RESUMABLE,
    RUN_FILE,
    RUNNING,
    atomic_path,
    claim_folder,
    clear_folder,
    read_json,
    to_json,
    write_json,
)
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.extensions.study.rules import leaves
from hexapod_cosim.extensions.study.store import BOOLEAN, INTEGER, REAL, TEXT, WALL, Store, quoted

KIND = "study"  # in run.json
MANIFEST, RESULTS, OPTIMUM = "manifest.json", "results.parquet", "optimum.json"
MAX_NAMED = 6  # differences in a message
PARQUET_TYPES = {INTEGER: pa.int64(), REAL: pa.float64(), TEXT: pa.string(), BOOLEAN: pa.bool_()}


def begin_folder(folder: Path, manifest: Mapping[str, Any], *, command: str) -> None:
    """Writes the manifest into a new folder, or checks that the folder has the same one.

    Raises HexapodError when the folder holds anything else or cannot be written. The files of
    an earlier run are deleted.

    Args:
        command: the command line that repeats the study.
    """
    if (folder / MANIFEST).exists():
        _compare(read_json(folder / MANIFEST), json.loads(to_json(manifest)), folder)
        return
    claim_folder(folder)
    clear_folder(folder)
    write_json(folder / MANIFEST, manifest)
    facts = {"kind": KIND, "status": RUNNING, "title": manifest["title"], "command": command}
    facts |= {RESUMABLE: True}
    write_json(folder / RUN_FILE, facts)


def finish_folder(folder: Path) -> None:
    """Marks the study as completed."""
    write_json(folder / RUN_FILE, {**read_json(folder / RUN_FILE), "status": COMPLETED})


def _compare(stored: Mapping[str, Any], now: Mapping[str, Any], folder: Path) -> None:
    """Raises StudyError when two manifests differ."""
    old, new = dict(leaves(stored)), dict(leaves(now))
    found = [
        f"{name} was {old.get(name)!s:.40}, is {new.get(name)!s:.40}"
        for name in {**old, **new}
        if old.get(name) != new.get(name)
    ]
    if found:
        raise StudyError(
            "the folder holds another study's runs",
            got="; ".join(found[:MAX_NAMED]),
            expected="what they were begun with",
            fix="choose another folder with -o, or put back what changed",
            where=str(folder),
        )


def export_runs(store: Store, folder: Path) -> None:
    """Writes results.parquet. The file is never partial; units are in the metadata of columns.

    The file's metadata have the entries of the manifest as JSON under hexapod.NAME, by which it
    can be trusted without its folder.
    """
    columns = [item for item in store.columns if item.name != WALL]
    names = ", ".join(quoted(item.name) for item in columns)
    rows = store.select(f"SELECT {names} FROM runs ORDER BY run")
    kinds = [PARQUET_TYPES[item.kind.split()[0]] for item in columns]
    fields = [
        pa.field(item.name, kind, metadata={"unit": item.unit} if item.unit else None)
        for item, kind in zip(columns, kinds, strict=True)
    ]
    manifest = read_json(folder / MANIFEST)
    metadata = {f"hexapod.{name}": _compact_json(value) for name, value in manifest.items()}
    arrays = [pa.array([row[k] for row in rows], kind) for k, kind in enumerate(kinds)]
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=metadata))
    with atomic_path(folder / RESULTS) as part:
        pq.write_table(table, part, compression="zstd")


def _compact_json(content: Any) -> str:
    """Returns JSON in one line, or a text as it is."""
    if isinstance(content, str):
        return content
    return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
