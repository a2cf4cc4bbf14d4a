"""Reads and checks values of a study file's keys. All functions raise StudyError."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hexapod_cosim.extensions.study.records import StudyError
from hexapod_cosim.models import unknown_name

LARGEST = 2**63 - 1  # integer of TOML and of a column
MAX_LENGTH = 1000  # characters of a text


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
    """Checks that the keys of a table are known."""
    for key in names:
        if key not in known:
            raise unknown_name("key", key, known, where=where, error=StudyError)


def is_number(value: Any) -> bool:
    """Returns whether a value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def check_plain(value: Any, where: str) -> None:
    """Checks that JSON and a column can hold a value and all values in it."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            check_plain(item, f"{where}{'.' if ': ' in where else ': '}{key}")
    elif isinstance(value, list):
        for place, item in enumerate(value):
            check_plain(item, f"{where}[{place}]")
    elif isinstance(value, int):
        require(abs(value) <= LARGEST, value, "a whole number within 64 bits", where)
    elif isinstance(value, float):
        require(math.isfinite(value), value, "a finite number", where)
    else:
        plain = isinstance(value, str) and len(value) <= MAX_LENGTH and value.isprintable()
        expected = f"a number, true, false or a printable text of at most {MAX_LENGTH} characters"
        require(plain, value, expected, where)


def whole(value: Any, where: str, *, least: int, most: int) -> int:
    """Returns a whole number within bounds."""
    fits = isinstance(value, int) and not isinstance(value, bool) and least <= value <= most
    require(fits, value, f"a whole number >= {least} and <= {most}", where)
    return int(value)


def table_of(value: Any, where: str, fix: str) -> Mapping[str, Any]:
    """Returns a table."""
    require(isinstance(value, Mapping), value, "a table", where, fix=fix)
    return dict(value)


def text_of(table: Mapping[str, Any], key: str, default: str, where: str) -> str:
    """Returns the text under a key."""
    value = table.get(key, default)
    require(isinstance(value, str), value, "a text in quotes", f"{where}: {key}")
    return str(value)


def texts_of(value: Any, where: str, example: str) -> tuple[str, ...]:
    """Returns a list of one or more different texts."""
    listed = isinstance(value, list) and all(isinstance(item, str) for item in value)
    different = listed and 0 < len(value) == len(set(value))
    what = "missing key" if value is None else "value not allowed"
    require(different, value, "a list of different texts", where, what=what, fix=f"write {example}")
    return tuple(value)


def names_of(value: Any, known: Sequence[str], where: str) -> tuple[str, ...]:
    """Returns a list of one or more different names among `known`."""
    names = texts_of(value, where, f"some of {', '.join(known)}")
    for item in names:
        if item not in known:
            raise unknown_name("name", item, known, where=where, error=StudyError)
    return names


def read_seeds(value: Any, where: str, *, most: int) -> Sequence[int]:
    """Returns seeds from their number, { first, count } or a list of them."""
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
    """Returns the values of nested tables by their names with dots, each of which is given once."""
    found: dict[str, Any] = {}
    for name, value in _leaves(table, ""):
        require_once(name, name in found, f"{where}.{name}")
        found[name] = value
    return found


def require_once(name: str, again: bool, where: str) -> None:
    """Checks that a name is not there already."""
    require(not again, name, "each name once", where, what="given twice", fix="take one away")


def _leaves(table: Mapping[str, Any], before: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value
