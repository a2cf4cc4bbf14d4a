"""Atomic writing of files, and the folder that a command writes into."""

from __future__ import annotations

import json
import math
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO
from uuid import uuid4

from hexapod_cosim.models import HexapodError
from hexapod_cosim.models.errors import refuse_path
from hexapod_cosim.models.files import read_text

RUN_FILE = "run.json"  # marks a folder as written by this package
RUNNING = "running"
RESUMABLE = "resumable"  # key of run.json: the folder is not cleared, since its runs go on
RESULT_FILES = (
    "results.parquet",
    "results.csv",
    "results.mcap",
    "commands.csv",
    "results.partial.parquet",
    "results.partial.csv",
    "results.partial.mcap",
    "seeds.csv",
    "metrics.json",
    "scenario.toml",
    "ground.terrain",
    "report.html",
    "plots",
)
RESERVED_NAMES = frozenset((*RESULT_FILES, RUN_FILE))  # no folder of a control has such a name
PARTS = "controls"  # key of run.json: labels of a comparison, whose runs have folders of their own


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yields a temporary path beside `path`, which replaces `path` when the block succeeds and is
    deleted when it fails.

    Raises HexapodError when `path` is a folder or cannot be written.
    """
    refuse_path(path, "a file to write", HexapodError)
    if path.is_dir():
        raise HexapodError(
            "cannot write",
            got="a folder",
            expected="the name of a file",
            fix="name a file in it with -o",
            where=str(path),
        )
    temporary = path.with_name(f".{path.name}.{uuid4().hex[:8]}{path.suffix}")
    try:
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise not_writable(path.parent, error) from error
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise not_writable(path, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def named(path: Path, suffix: str, name: str = "robot") -> Path:
    """Returns a path with a suffix, for a message; a folder such as "." or "/" gets a file too."""
    return path.with_suffix(suffix) if path.name else path / f"{name}{suffix}"


def file_stamp(path: Path) -> tuple[int, int]:
    """Returns the time of the last change [ns] and the size [byte] of a file: a cache whose key has
    them reads a changed file again. Raises OSError without the file.
    """
    facts = path.stat()
    return facts.st_mtime_ns, facts.st_size


@contextmanager
def atomic_text(path: Path) -> Iterator[TextIO]:
    """Yields a text file (UTF-8) that replaces `path` when the block succeeds."""
    with (
        atomic_path(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as file,
    ):
        yield file


def write_text(path: Path, text: str) -> None:
    """Writes a text file atomically."""
    with atomic_text(path) as file:
        file.write(text)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a JSON file atomically; NaN and infinities become null."""
    write_text(path, to_json(content) + "\n")


def to_json(content: Any) -> str:
    """Returns standard JSON: NaN and infinities become null."""
    return json.dumps(_finite(content), indent=2, ensure_ascii=False)


def _finite(value: Any) -> Any:
    """Replaces NaN and infinities in nested values by None."""
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def without_none(content: Any) -> Any:
    """Returns nested values without None, which JSON has for infinities and TOML lacks."""
    if isinstance(content, Mapping):
        return {key: without_none(value) for key, value in content.items() if value is not None}
    return [without_none(value) for value in content] if isinstance(content, list) else content


def why_unreadable(error: Exception, kind: str) -> str:
    """Returns in words why a file cannot be read as a file of some kind."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, KeyError):  # its text begins with the key
        return f"a file without {str(error.args[0]).partition(' ')[0]}"
    return f"a file that is no {kind}"


def not_writable(path: Path, error: OSError) -> HexapodError:
    """Returns the error for a path that cannot be written."""
    got, expected = error.strerror or str(error), "a place that can be written to"
    if isinstance(error, FileExistsError | NotADirectoryError):
        got, expected = "a file where a folder should be", "a folder"
    fix = "choose another place"
    return HexapodError("cannot write", got=got, expected=expected, fix=fix, where=str(path))


@contextmanager
def writing_into(folder: Path) -> Iterator[None]:
    """Creates a folder and turns the system's errors in the block into a HexapodError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise not_writable(folder, error) from error


def claim_folder(folder: Path) -> list[Path]:
    """Checks that results can be written to a folder, and creates it if need be.

    Returns the folders that were created, the innermost first. Raises HexapodError when the folder
    holds other files or cannot be written.
    """
    refuse_path(folder, "a folder to write", HexapodError)
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        entries = [entry.name for entry in folder.iterdir()]
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise not_writable(folder, error) from error
    if RUN_FILE in entries and read_json(folder / RUN_FILE).get(RESUMABLE):
        raise HexapodError(
            "the folder holds runs that can be resumed",
            got=str(folder),
            expected="a folder of its own",
            fix="choose another with -o",
        )
    if entries and RUN_FILE not in entries:
        expected = f"a new or empty folder, or an earlier run's (it has {RUN_FILE})"
        raise HexapodError(
            "the folder holds other files",
            got=sorted(entries)[0],
            expected=expected,
            fix="choose another with -o",
            where=str(folder),
        )
    return made


def clear_folder(
    folder: Path, parts: Sequence[str] = (), files: Sequence[str] = RESULT_FILES
) -> None:
    """Deletes an earlier run's files from a claimed folder and marks it as a running run's.

    `parts`: names of the folders in it that the new run will write; `files`: those to delete.
    Raises HexapodError when the folder cannot be written.
    """
    try:
        folder.mkdir(exist_ok=True)
        for name in (*files, *_earlier_parts(folder)):
            _remove(folder / name)
        write_json(folder / RUN_FILE, {"status": RUNNING} | ({PARTS: list(parts)} if parts else {}))
    except OSError as error:
        raise not_writable(folder, error) from error


def _earlier_parts(folder: Path) -> list[str]:
    """Returns the names of the folders that an earlier comparison wrote in its folder."""
    try:
        names = json.loads((folder / RUN_FILE).read_text(encoding="utf-8"))[PARTS]
    except (OSError, ValueError, KeyError, TypeError):
        names = []
    own = [name for name in names if isinstance(name, str) and Path(name).name == name]
    return [name for name in own if (folder / name / RUN_FILE).is_file()]


def _remove(path: Path) -> None:
    """Deletes a file or folder, if it exists."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def read_json(path: Path) -> Any:
    """Reads a JSON file of a results folder. Raises HexapodError when it is missing or damaged."""
    try:
        return json.loads(read_text(path))
    except (FileNotFoundError, NotADirectoryError) as error:
        raise HexapodError(
            "not a results folder",
            got=str(path.parent),
            expected=f"a folder with {path.name}",
            fix="give a folder that a command of `hexapod` wrote, such as simulate or compare",
        ) from error
    except OSError as error:
        raise not_writable(path, error) from error
    except (ValueError, RecursionError) as error:
        raise HexapodError(
            "damaged file",
            got=str(error),
            expected="JSON",
            fix="run the scenario again",
            where=str(path),
        ) from error
