"""Reads and checks values of a study file's keys."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.models import unknown_name

LARGEST = 2**63 - 1  # integer of TOML and of a column
MAX_LENGTH = 1000  # characters of a text
MAX_DEPTH = 12  # of nested tables and lists


def require(
    holds: bool,
    got: Any,
    expected: str,
    where: str,
    *,
    what: str = "value not allowed",
    fix: str = "correct it",
) -> None:
    """Raises StudyError unless a condition holds; see HexapodError for the texts."""
    if not holds:
        raise StudyError(what, got=got, expected=expected, fix=fix, where=where)


def require_known(names: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    """Raises StudyError for a key of a table that is not known."""
    for key in names:
        if key not in known:
            raise unknown_name("key", key, known, where=where, error=StudyError)


def is_number(value: Any) -> bool:
    """Returns whether a value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def check_plain(value: Any, where: str, depth: int = 0) -> None:
    """Raises StudyError for a value that JSON or a column cannot hold unchanged."""
    deep = f"no more than {MAX_DEPTH} nested tables or lists"
    require(depth <= MAX_DEPTH, None, deep, where, what="too deep", fix="take it apart")
    if isinstance(value, Mapping):
        for key, item in value.items():
            check_plain(item, f"{where}{'.' if depth else ': '}{key}", depth + 1)
    elif isinstance(value, list):
        for place, item in enumerate(value):
            check_plain(item, f"{where}[{place}]", depth + 1)
    elif isinstance(value, int):
        require(abs(value) <= LARGEST, value, "a whole number within 64 bits", where)
    elif isinstance(value, float):
        require(math.isfinite(value), value, "a finite number", where)
    else:
        plain = isinstance(value, str) and len(value) <= MAX_LENGTH and value.isprintable()
        expected = f"a number, true, false or a printable text of at most {MAX_LENGTH} characters"
        require(plain, value, expected, where)


def whole(value: Any, where: str, *, least: int, most: int) -> int:
    """Returns a whole number within bounds. Raises StudyError."""
    fits = isinstance(value, int) and not isinstance(value, bool) and least <= value <= most
    require(fits, value, f"a whole number >= {least} and <= {most}", where)
    return int(value)


def text_of(table: Mapping[str, Any], key: str, default: str, where: str) -> str:
    """Returns the text under a key. Raises StudyError."""
    value = table.get(key, default)
    require(isinstance(value, str), value, "a text in quotes", f"{where}: {key}")
    return str(value)


def boolean_of(table: Mapping[str, Any], key: str, default: bool, where: str) -> bool:
    """Returns the boolean under a key. Raises StudyError."""
    value, fix = table.get(key, default), f"write {key} = true, without quotes"
    require(isinstance(value, bool), value, "true or false", f"{where}: {key}", fix=fix)
    return bool(value)


def names_of(value: Any, known: Sequence[str], where: str) -> tuple[str, ...]:
    """Returns a list of one or more different names among `known`. Raises StudyError."""
    different = isinstance(value, list) and 0 < len(value) == len(set(map(str, value)))
    require(different, value, f"a list of some of {', '.join(known)}", where)
    for item in value:
        if item not in known:
            raise unknown_name("name", str(item), known, where=where, error=StudyError)
    return tuple(value)


def read_seeds(value: Any, where: str, *, most: int) -> Sequence[int]:
    """Returns seeds from their number, { first, count } or a list of them. Raises StudyError."""
    if isinstance(value, Mapping):
        require_known(value, ("first", "count"), where)
        count = whole(value.get("count", 1), f"{where}.count", least=1, most=most)
        first = whole(value.get("first", 0), f"{where}.first", least=0, most=LARGEST - count)
        return range(first, first + count)
    if isinstance(value, list):
        different = 0 < len(value) == len(set(map(str, value)))
        require(different, value, "different whole numbers", where, fix="write seeds = 10")
        return tuple(whole(item, where, least=0, most=LARGEST) for item in value)
    return range(whole(value, where, least=1, most=most))


def flat(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Returns the values of nested tables by their names with dots.

    Raises StudyError for a name that is given twice.
    """
    found: dict[str, Any] = {}
    for name, value in _leaves(table, ""):
        require_once(name, name in found, f"{where}.{name}")
        found[name] = value
    return found


def require_once(name: str, again: bool, where: str) -> None:
    """Raises StudyError for a name that is there already."""
    require(not again, name, "each name once", where, what="given twice", fix="take one away")


def _leaves(table: Mapping[str, Any], before: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value
