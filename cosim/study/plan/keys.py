"""Reads and checks values of a study file's keys."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.models import unknown_name

LARGEST = 2**63 - 1  # integer of TOML and of a Parquet column
MAX_LENGTH = 1000  # characters of a text
MAX_DEPTH = 12  # of nested tables and lists


def check_plain(value: Any, where: str, depth: int = 0) -> None:
    """Raises StudyError for a value that JSON or a Parquet column cannot hold unchanged."""
    if depth > MAX_DEPTH:
        raise StudyError(
            "too deep",
            expected=f"no more than {MAX_DEPTH} nested tables or lists",
            fix="take it apart",
            where=where,
        )
    if isinstance(value, Mapping | list):
        for key, item in value.items() if isinstance(value, Mapping) else enumerate(value):
            check_plain(
                item,
                f"{where}[{key}]"
                if isinstance(value, list)
                else f"{where}{'.' if depth else ': '}{key}",
                depth + 1,
            )
    elif isinstance(value, bool):
        return
    elif isinstance(value, int | float):
        if not (abs(value) <= LARGEST if isinstance(value, int) else math.isfinite(value)):
            raise StudyError(
                "value not allowed",
                got=value,
                expected="a finite number; a whole one within 64 bits",
                fix="correct it",
                where=where,
            )
    elif not isinstance(value, str) or len(value) > MAX_LENGTH or not value.isprintable():
        got = (
            value
            if not isinstance(value, str) or len(value) < MAX_LENGTH
            else f"{len(value)} characters"
        )
        expected = (
            f"a number, true or false, or a printable text of at most {MAX_LENGTH} characters"
        )
        raise StudyError(
            "value not allowed", got=got, expected=expected, fix="correct it", where=where
        )


def whole(value: Any, where: str, *, least: int, most: int | None = None) -> int:
    """Returns a whole number within bounds. Raises StudyError."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int)
        or value < least
        or (most is not None and value > most)
    ):
        expected = f"a whole number >= {least}" + ("" if most is None else f" and <= {most}")
        raise StudyError(
            "value not allowed", got=value, expected=expected, fix="correct it", where=where
        )
    return value


def text_of(table: Mapping[str, Any], key: str, default: str, where: str) -> str:
    """Returns the text under a key. Raises StudyError."""
    value = table.get(key, default)
    if not isinstance(value, str):
        raise StudyError(
            "wrong type", got=value, expected="a text in quotes", where=f"{where}: {key}"
        )
    return value


def boolean_of(table: Mapping[str, Any], key: str, default: bool, where: str) -> bool:
    """Returns the boolean under a key. Raises StudyError."""
    value = table.get(key, default)
    if not isinstance(value, bool):
        raise StudyError(
            "wrong type",
            got=value,
            expected="true or false",
            fix=f"write {key} = true, without quotes",
            where=f"{where}: {key}",
        )
    return value


def names_of(value: Any, known: Sequence[str], where: str) -> tuple[str, ...]:
    """Returns a list of one or more different names among `known`. Raises StudyError."""
    if not isinstance(value, list) or not value or len({str(item) for item in value}) != len(value):
        raise StudyError(
            "wrong type", got=value, expected=f"a list of some of {', '.join(known)}", where=where
        )
    for item in value:
        if item not in known:
            raise unknown_name("name", str(item), known, where=where, error=StudyError)
    return tuple(value)


def read_seeds(value: Any, where: str, *, most: int) -> Sequence[int]:
    """Returns seeds from their number, { first, count } or a list of them. Raises StudyError."""
    if isinstance(value, Mapping):
        for key in value:
            if key not in ("first", "count"):
                raise unknown_name("key", key, ("first", "count"), where=where, error=StudyError)
        count = whole(value.get("count", 1), f"{where}.count", least=1, most=most)
        first = whole(value.get("first", 0), f"{where}.first", least=0, most=LARGEST - count)
        return range(first, first + count)
    if isinstance(value, list):
        if not value or len(set(map(str, value))) != len(value):
            raise StudyError(
                "not seeds",
                got=value,
                expected="different whole numbers >= 0",
                fix="write seeds = 10",
                where=where,
            )
        return tuple(whole(item, where, least=0, most=LARGEST) for item in value)
    return range(whole(value, where, least=1, most=most))


def flat(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Returns the values of nested tables by their names with dots.

    Raises StudyError for a name that is given twice.
    """
    found: dict[str, Any] = {}
    for name, value in _leaves(table, ""):
        if name in found:
            raise StudyError(
                "given twice",
                got=name,
                expected="each name once",
                fix="take one of them away",
                where=f"{where}.{name}",
            )
        found[name] = value
    return found


def _leaves(table: Mapping[str, Any], before: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value
