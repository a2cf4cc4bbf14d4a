"""Values of a study file's keys, each judged."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hexapod_cosim.cosim.study.plan.records import StudyError
from hexapod_cosim.models import unknown_name

LARGEST = 2**63 - 1  # a whole number of TOML, and of a column
MOST_LETTERS, MOST_DEPTH = 1000, 12  # of a text, of tables in tables


def check_plain(value: Any, where: str, depth: int = 0) -> None:
    """Nothing in a file that could not be kept as JSON and in columns, and read again the same.
    Raises StudyError.
    """
    if depth > MOST_DEPTH:
        raise StudyError(
            "too deep",
            expected=f"no more than {MOST_DEPTH} tables or lists in each other",
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
    elif not isinstance(value, str) or len(value) > MOST_LETTERS or not value.isprintable():
        got = (
            value
            if not isinstance(value, str) or len(value) < MOST_LETTERS
            else f"{len(value)} letters"
        )
        expected = f"a number, true or false, or a printable text of at most {MOST_LETTERS} letters"
        raise StudyError(
            "value not allowed", got=got, expected=expected, fix="correct it", where=where
        )


def whole(value: Any, where: str, *, least: int, most: int | None = None) -> int:
    """A whole number within bounds. Raises StudyError."""
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
    """A text. Raises StudyError."""
    value = table.get(key, default)
    if not isinstance(value, str):
        raise StudyError(
            "wrong type", got=value, expected="a text in quotes", where=f"{where}: {key}"
        )
    return value


def truth_of(table: Mapping[str, Any], key: str, default: bool, where: str) -> bool:
    """True or false. Raises StudyError."""
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
    """Different names of a closed list, one at least. Raises StudyError."""
    if not isinstance(value, list) or not value or len({str(item) for item in value}) != len(value):
        raise StudyError(
            "wrong type", got=value, expected=f"a list of some of {', '.join(known)}", where=where
        )
    for item in value:
        if item not in known:
            raise unknown_name("name", str(item), known, where=where, error=StudyError)
    return tuple(value)


def read_seeds(value: Any, where: str, *, most: int) -> Sequence[int]:
    """A number of seeds from 0 on, { first, count }, or the seeds themselves. Raises StudyError."""
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
    """Values by name with dots, written in quotes or as tables. Raises StudyError for a name
    that is given twice.
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
