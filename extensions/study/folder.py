"""The folder of a study: the manifest, by which another study is refused, and the exported table.

results.parquet has all runs in the order of their numbers and is the same however they were run.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from filelock import FileLock, Timeout

from hexapod_cosim.cosim.common.files import (
    RESUMABLE,
    RUN_FILE,
    RUNNING,
    atomic_path,
    not_writable,
    read_json,
    to_json,
    write_json,
)
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.extensions.study.store import BOOLEAN, INTEGER, REAL, TEXT, WALL, Store

STUDY = "study"  # kind of the folder, in run.json

MANIFEST, LOCK, RESULTS = "manifest.json", ".lock", "results.parquet"
COMPRESSION = "zstd"
METADATA_PREFIX = "hexapod."  # of the keys of a file's metadata
MAX_NAMED = 6  # differences in a message
PARQUET_TYPES = {
    INTEGER: pa.int64(),
    REAL: pa.float64(),
    TEXT: pa.string(),
    BOOLEAN: pa.bool_(),
}


def begin_folder(folder: Path, manifest: Mapping[str, Any], *, command: str) -> None:
    """Writes the manifest into a new folder, or checks that the folder has the same one.

    Raises StudyError when the folder holds anything else, HexapodError when it cannot be written.

    Args:
        command: the command line that repeats the study.
    """
    if (folder / MANIFEST).exists():
        _compare(read_json(folder / MANIFEST), json.loads(to_json(manifest)), folder)
        return
    try:
        entries = sorted(entry.name for entry in folder.iterdir() if entry.name[0] != ".")
    except OSError as error:
        raise not_writable(folder, error) from error
    if entries and entries != [RUN_FILE]:
        raise StudyError(
            "the folder holds other files",
            got=entries[0],
            expected=f"a new or empty folder, or this study's (it has {MANIFEST})",
            fix="choose another with -o",
            where=str(folder),
        )
    facts = {"kind": STUDY, "status": RUNNING, "title": manifest["title"]}
    facts |= {"command": command, RESUMABLE: True}
    write_json(folder / RUN_FILE, facts)
    write_json(folder / MANIFEST, manifest)


def finish_folder(folder: Path) -> None:
    """Marks the study as completed."""
    write_json(folder / RUN_FILE, {**read_json(folder / RUN_FILE), "status": COMPLETED})


def _compare(stored: Mapping[str, Any], now: Mapping[str, Any], folder: Path) -> None:
    """Raises StudyError when two manifests differ."""
    found = list(differences(stored, now))
    if found:
        more = f" and {len(found) - MAX_NAMED} more" if len(found) > MAX_NAMED else ""
        raise StudyError(
            "the folder holds another study's runs",
            got="; ".join(found[:MAX_NAMED]) + more,
            expected="what they were begun with",
            fix="choose another folder with -o, or put back what changed",
            where=str(folder),
        )


def differences(stored: Any, now: Any, name: str = "") -> Iterator[str]:
    """Yields a sentence for each entry in which two manifests differ."""
    if isinstance(stored, Mapping) and isinstance(now, Mapping):
        for key in dict.fromkeys([*stored, *now]):
            yield from differences(stored.get(key), now.get(key), f"{name}.{key}" if name else key)
    elif stored != now:
        yield f"{name} was {_short(stored)}, is {_short(now)}"


def _short(value: Any) -> str:
    text = "not there" if value is None else json.dumps(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Makes the folder and locks it: within the block no other process runs a study into it.

    Raises StudyError when another process has the lock, HexapodError when the folder cannot be
    written. On a file system without locks the folder is not locked.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / LOCK).touch()
    except OSError as error:
        raise not_writable(folder, error) from error
    lock = FileLock(folder / LOCK, blocking=False, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise StudyError(
            "another process runs a study into this folder",
            fix="wait for it, or choose another with -o",
            where=str(folder),
        ) from error
    except OSError:
        pass  # a file system without locks
    try:
        yield
    finally:
        lock.release()


def export_runs(store: Store, folder: Path) -> None:
    """Writes results.parquet. The file is never partial; units are in the metadata of columns."""
    columns = [item for item in store.columns if item.name != WALL]
    fields = [
        pa.field(
            item.name,
            PARQUET_TYPES[item.kind.split()[0]],
            metadata={"unit": item.unit} if item.unit else None,
        )
        for item in columns
    ]
    schema = pa.schema(fields, metadata=provenance(read_json(folder / MANIFEST)))
    with (
        atomic_path(folder / RESULTS) as part,
        pq.ParquetWriter(part, schema, compression=COMPRESSION) as writer,
    ):
        for rows in store.tables(columns):
            values = zip(zip(*rows, strict=True), schema.types, strict=True)
            arrays = [pa.array(column, kind) for column, kind in values]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


def provenance(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Returns the metadata of a file of results, by which it can be trusted without its folder.

    They depend on the study only, not on where, when and how often it was run: the entries of the
    manifest as JSON under hexapod.NAME, and the SHA-256 of the gains.
    """
    found = {
        f"{METADATA_PREFIX}{name}": value if isinstance(value, str) else _compact_json(value)
        for name, value in manifest.items()
    }
    gains = found[f"{METADATA_PREFIX}gains"].encode()
    return found | {f"{METADATA_PREFIX}gains_sha256": hashlib.sha256(gains).hexdigest()}


def _compact_json(content: Any) -> str:
    """Returns JSON in one line, with the keys in their order."""
    return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
