"""What a study's folder says of itself: enough to run it again, and to refuse going on with
anything else.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from time import time
from typing import Any

from hexapod_cosim.cosim.common.files import (
    RUN_FILE,
    RUNNING,
    STUDY,
    not_writable,
    read_json,
    to_json,
)
from hexapod_cosim.cosim.common.locks import HELD, lock_file
from hexapod_cosim.cosim.master.loop import COMPLETED
from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.cosim.study.store.store import LEFTOVERS, write_durably

MANIFEST, LOCK, RUNS, RESULTS, TIMES = (
    "manifest.json",
    ".lock",
    "runs",
    "results.parquet",
    "times.parquet",
)
FORMAT = 1
OF_FILE = "hexapod."  # keys of a file's metadata
MOST_NAMED = 6  # differences in a message
WHILE = 600.0  # s    after which nobody is writing a file any more


def provenance(manifest: Mapping[str, Any]) -> dict[str, str]:
    """What a file of results needs to be trusted by itself, as texts for its metadata; the same
    however, wherever and how often it was run.

    By hexapod.NAME: format, study (its file as JSON), scenarios (in full), seeds, engine,
    environment (versions), fmus, controller and robots (SHA-256), gains (as JSON, and their
    SHA-256).
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
        f"{OF_FILE}{name}": manifest[name]
        if isinstance(manifest[name], str)
        else _plain(manifest[name])
        for name in names
    }
    return found | {
        f"{OF_FILE}gains_sha256": hashlib.sha256(found[f"{OF_FILE}gains"].encode()).hexdigest()
    }


def _plain(content: Any) -> str:
    """JSON in one line, in the content's own order."""
    return json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def begin_folder(folder: Path, manifest: Mapping[str, Any], *, command: str) -> None:
    """Makes the folder the study's, or sees that it is: the same study, FMU, gains and versions.
    Raises StudyError, HexapodError.
    """
    if (folder / MANIFEST).exists():
        _compare(read_json(folder / MANIFEST), json.loads(to_json(manifest)), folder)
        return
    try:
        entries = sorted(
            entry.name
            for entry in folder.iterdir()
            if entry.name != LOCK and not entry.match(LEFTOVERS)
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


def clear_leftovers(folder: Path, *, shared: Sequence[str]) -> None:
    """Takes half-written files of killed processes away; of `shared` files, which others may
    write just now, after a while.
    """
    for left in folder.glob(LEFTOVERS):
        with suppress(OSError):
            if (
                not left.name.startswith(tuple(f".{name}." for name in shared))
                or time() - left.stat().st_mtime > WHILE
            ):
                left.unlink()


def finish_folder(folder: Path) -> None:
    """Says that all is there."""
    write_durably(folder / RUN_FILE, _text({**read_json(folder / RUN_FILE), "status": COMPLETED}))


def _text(content: Mapping[str, Any]) -> bytes:
    return (to_json(content) + "\n").encode()


def _compare(stored: Mapping[str, Any], now: Mapping[str, Any], folder: Path) -> None:
    found = list(differences(stored, now))
    if found:
        more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        fix = "choose another folder with -o, or put back what changed"
        raise StudyError(
            "the folder holds another study's runs",
            got="; ".join(found[:MOST_NAMED]) + more,
            expected="what they were begun with",
            fix=fix,
            where=str(folder),
        )


def differences(stored: Any, now: Any, name: str = "") -> Iterator[str]:
    """In words, where two manifests differ."""
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
    """Makes the folder if need be; no other process runs a study into it meanwhile. Raises
    StudyError, HexapodError.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK).open("w")
    except OSError as error:
        raise not_writable(folder, error) from error
    with file:
        try:
            lock_file(file)
        except OSError as error:
            if error.errno in HELD:
                fix = "wait for it, or choose another with -o"
                raise StudyError(
                    "another process runs a study into this folder", fix=fix, where=str(folder)
                ) from error
        yield
