"""The manifest of a study's folder, which allows to repeat the study and to refuse another one."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from time import time
from typing import Any

from filelock import FileLock, Timeout

from hexapod_cosim.cosim.common.files import (
    RUN_FILE,
    RUNNING,
    STUDY,
    not_writable,
    read_json,
    to_json,
)
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.cosim.study.store.store import UNFINISHED, write_durably

MANIFEST, LOCK, RUNS, RESULTS, TIMES = (
    "manifest.json",
    ".lock",
    "runs",
    "results.parquet",
    "times.parquet",
)
FORMAT = 1
METADATA_PREFIX = "hexapod."  # of the keys of a file's metadata
MAX_NAMED = 6  # differences in a message
MAX_WRITE_TIME = 600.0  # s    after which an unfinished file is of a process that was killed


def provenance(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Returns the metadata of a file of results, by which it can be trusted without its folder.

    The metadata depend on the study only, not on where, when and how often it was run. Keys are
    hexapod.NAME with NAME: format, study (its file as JSON), scenarios (in full), seeds, engine,
    environment (versions), fmus, controller and robots (SHA-256), gains (as JSON), gains_sha256
    and, of a study with users' controls, laws (SHA-256 by label).
    """
    names = (
        "format",
        "title",
        "study",
        "scenarios",
        "runs",
        "seeds",
        "engine",
        "environment",
        "fmus",
        "controller",
        "robots",
        "gains",
    )
    found = {
        f"{METADATA_PREFIX}{name}": manifest[name]
        if isinstance(manifest[name], str)
        else _compact_json(manifest[name])
        for name in (*names, *(["laws"] if "laws" in manifest else []))
    }
    gains = found[f"{METADATA_PREFIX}gains"].encode()
    return found | {f"{METADATA_PREFIX}gains_sha256": hashlib.sha256(gains).hexdigest()}


def _compact_json(content: Any) -> str:
    """Returns JSON in one line, with the keys in their order."""
    return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


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
        entries = sorted(
            entry.name
            for entry in folder.iterdir()
            if entry.name != LOCK and not entry.match(UNFINISHED)
        )
    except OSError as error:
        raise not_writable(folder, error) from error
    if entries and entries != [RUN_FILE]:
        expected = f"a new or empty folder, or this study's (it has {MANIFEST})"
        raise StudyError(
            "the folder holds other files",
            got=entries[0],
            expected=expected,
            fix="choose another with -o",
            where=str(folder),
        )
    write_durably(
        folder / RUN_FILE,
        _text({"kind": STUDY, "status": RUNNING, "title": manifest["title"], "command": command}),
    )
    write_durably(folder / MANIFEST, _text(manifest))


def remove_unfinished(folder: Path, *, shared: Sequence[str]) -> None:
    """Removes unfinished files of processes that were killed.

    Args:
        shared: names of files that other processes may be writing; their unfinished versions are
            removed after MAX_WRITE_TIME.
    """
    prefixes = tuple(f".{name}." for name in shared)
    for path in folder.glob(UNFINISHED):
        with suppress(OSError):
            old = time() - path.stat().st_mtime > MAX_WRITE_TIME
            if old or not path.name.startswith(prefixes):
                path.unlink()


def finish_folder(folder: Path) -> None:
    """Marks the study as completed."""
    write_durably(folder / RUN_FILE, _text({**read_json(folder / RUN_FILE), "status": COMPLETED}))


def _text(content: Mapping[str, Any]) -> bytes:
    return (to_json(content) + "\n").encode()


def _compare(stored: Mapping[str, Any], now: Mapping[str, Any], folder: Path) -> None:
    """Raises StudyError when two manifests differ."""
    found = list(differences(stored, now))
    if found:
        more = f" and {len(found) - MAX_NAMED} more" if len(found) > MAX_NAMED else ""
        fix = "choose another folder with -o, or put back what changed"
        raise StudyError(
            "the folder holds another study's runs",
            got="; ".join(found[:MAX_NAMED]) + more,
            expected="what they were begun with",
            fix=fix,
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
