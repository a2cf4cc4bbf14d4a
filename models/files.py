"""Reads small files with a limit, so that no device and no huge file fills the memory, and TOML
files with errors of one class, and merges their tables.
"""

from __future__ import annotations

import codecs
import errno
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from typing import Any

from hexapod_cosim.models.errors import HexapodError, unknown_name

LARGEST_FILE = 64 * 2**20  # bytes  of robots, scenarios, studies, gains, URDFs and JSON files
DEEPEST = 64  # the most tables and arrays inside each other in a TOML file
LARGEST = 2**63 - 1  # the largest integer of TOML 1.0
MAP_SIZE = 512 * 2**20  # bytes  of height maps and grids


def read_bytes(path: Path, limit: int = LARGEST_FILE) -> bytes:
    """Returns a file's content. Raises OSError, also for one of more than `limit` bytes."""
    with path.open("rb") as file:
        content = file.read(limit + 1)
    if len(content) > limit:
        raise OSError(errno.EFBIG, f"a file of more than {limit // 2**20} MiB", str(path))
    return content


def read_text(path: Path, *, encoding: str = "utf-8") -> str:
    """Returns the content of a text file, whose lines then end as on Unix.

    Raises OSError, also for more than LARGEST_FILE bytes, and UnicodeDecodeError.
    """
    text = read_bytes(path).decode(encoding)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_toml(text: str) -> dict[str, Any]:
    """Returns the tables of a TOML text.

    Raises tomllib.TOMLDecodeError, also for integers of more than 64 bits and for tables and arrays
    more than DEEPEST deep, where Python's reader raises other errors or none.
    """
    try:
        table = tomllib.loads(text)
        _check_size(table, DEEPEST)
    except tomllib.TOMLDecodeError as error:
        lines = text.split("\n")
        end = f"at line {len(lines)}, column {len(lines[-1]) + 1}"
        raise tomllib.TOMLDecodeError(str(error).replace("at end of document", end)) from error
    except RecursionError as error:
        raise tomllib.TOMLDecodeError(f"more than {DEEPEST} tables or arrays deep") from error
    except ValueError as error:  # thousands of digits
        raise tomllib.TOMLDecodeError("an integer of more than 64 bits") from error
    return table


@contextmanager
def decoding_toml(path: Path, *, kind: str, error: type[HexapodError]) -> Iterator[None]:
    """Turns errors of a TOML file's encoding and of parse_toml() into the class `error`.

    Args:
        path: the file.
        kind: of the file, as in "the path of a robot file".
        error: the class.
    """
    try:
        yield
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as cause:
        other = _other_format(path)
        what, place = _place_of(cause)
        fix = f"correct it at {path}:{place}" if place else f"correct {path}"
        raise error(
            "not a TOML file",
            got=other or what,
            expected="TOML 1.0 in UTF-8",
            fix=fix if other is None else f"give the path of a {kind} file",
            where=str(path),
        ) from cause


def preset_tables(folder: Path) -> Iterator[tuple[str, dict[str, Any], str]]:
    """Yields name, table and place for messages of each table in a folder's TOML files, sorted by
    name. A table has the keys of its file's [shared] that it does not give itself.
    """
    found: dict[str, tuple[dict[str, Any], str]] = {}
    for path in folder.glob("*.toml"):
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
        shared = tables.pop("shared", {})
        found |= {name: (shared | given, f"{path}: {name}") for name, given in tables.items()}
    for name in sorted(found):
        yield name, *found[name]


def path_of(
    path_or_name: str | Path, kind: str, bundled: Mapping[str, Path], error: type[HexapodError]
) -> Path:
    """Returns the path of a file that is given by its path or by its name in `bundled`.

    Such a name precedes a folder. Raises the class `error` for another name; kind: of the file.
    """
    path, name = Path(path_or_name), str(path_or_name)
    if path.suffix or len(path.parts) != 1 or path.is_file():
        return path
    if name not in bundled and not path.is_dir():
        raise unknown_name(kind, name, bundled, error=error)
    return bundled.get(name, path)


@contextmanager
def reading_toml(
    path: Path,
    *,
    kind: str,
    name: str,
    names: Callable[[], Iterable[str]],
    error: type[HexapodError],
) -> Iterator[None]:
    """Turns errors of reading a TOML file, of its encoding and of parse_toml() into one class.

    Args:
        path: the file.
        kind: of the file, as in "the path of a robot file".
        name: of what is read, with its article.
        names: returns the bundled files, which a message lists.
        error: the class.
    """
    try:
        with decoding_toml(path, kind=kind, error=error):
            yield
    except OSError as cause:
        fix = f"give the path of a {kind} file, or one of: " + ", ".join(names())
        raise error(f"cannot read {name}", got=cause.strerror, fix=fix, where=str(path)) from cause


def _place_of(cause: tomllib.TOMLDecodeError | UnicodeDecodeError) -> tuple[str, str]:
    """Returns what is wrong in a TOML file and where, as "LINE:COLUMN"; "" where it is unknown."""
    if isinstance(cause, UnicodeDecodeError):
        lines = cause.object[: cause.start].split(b"\n")
        return str(cause), f"{len(lines)}:{len(lines[-1]) + 1}"
    what, _, place = str(cause).partition(" (at line ")
    return what, place.rstrip(")").replace(", column ", ":")


def _other_format(path: Path) -> str | None:
    """Returns the format of a file that is often given by mistake, by its first bytes, or None."""
    with path.open("rb") as file:
        start = file.read(256).removeprefix(codecs.BOM_UTF8).lstrip()
    if start.startswith(b"PK\x03\x04"):
        return "a ZIP file, such as an FMU"
    if start.startswith(b"<"):
        return "an XML file, such as a URDF without the ending .urdf or a MuJoCo model"
    return "a binary file" if b"\0" in start else None


def _check_size(value: Any, depth: int) -> None:
    """Raises ValueError for large integers and RecursionError below the given depth."""
    if depth < 0:
        raise RecursionError
    if isinstance(value, int) and abs(value) > LARGEST:
        raise ValueError
    inner = value.values() if isinstance(value, dict) else value
    for item in inner if isinstance(value, dict | list) else ():
        _check_size(item, depth - 1)


def merged_tables(low: Mapping[str, Any], high: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a copy of the entries of two nested tables; those of `high` take precedence."""
    both = {
        key: merged_tables(low[key], high[key])
        for key in low
        if isinstance(low[key], Mapping) and isinstance(high.get(key), Mapping)
    }
    return deepcopy({**low, **high, **both})
